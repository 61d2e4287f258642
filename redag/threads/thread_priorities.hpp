// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// SCHED_FIFO priorities of threads that run one job each (0: an ordinary thread). A change is a system call of about 1
// us, and is avoided where possible. A thread that is given a short job keeps a higher priority from its previous job
// while that makes no difference among these threads. A value without threads of its own. Not thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace redag::runtime {

class ThreadPriorities {
 public:
  struct Change {
    std::size_t thread = 0;
    int priority = 0;
  };

  /// Starts with `threads` threads of that priority, all without a job.
  ThreadPriorities(std::size_t threads, int priority);

  /// While at most this many jobs are started, each has a processor and their order does not matter.
  void set_processors(std::size_t processors) { processors_ = processors; }

  // start(), change(), follow() and wait() return the required changes, valid until the next call. Nothing allocates.

  /// A thread without a job gets one of this priority.
  std::span<const Change> start(std::size_t thread, int priority, bool is_short);
  /// The thread's job gets another priority.
  std::span<const Change> change(std::size_t thread, int priority);
  void end(std::size_t thread);
  /// As end() and start(): the job of a thread is followed by another one.
  std::span<const Change> follow(std::size_t thread, int priority, bool is_short) {
    Thread &self = threads_[thread];
    if (!unordered_ && self.of_job == priority && self.priority == priority) return {};
    // The only thread that has a job keeps the priority that it has kept.
    const bool keeps = is_short && started_ == 1 && self.priority > std::max(priority, self.of_job);
    if (!keeps || unordered_) return end_and_place(self, priority, is_short);
    self.of_job = priority;
    return {};
  }
  /// A thread without a job waits with this priority. Its next job, if short, does not keep it.
  std::span<const Change> wait(std::size_t thread, int priority);

  [[nodiscard]] int of(std::size_t thread) const { return threads_[thread].priority; }

 private:
  struct Thread {
    int priority = 0;
    int of_job = 0;  // <= priority while started
    bool started = false;
    bool waited = false;      // it has its priority from wait()
    std::uint32_t place = 0;  // in raised_, if it is there
  };
  /// Counts threads by their priority. Tells in constant time whether some lie in a range.
  class Counts {
   public:
    void add(int priority) {
      if (counts_[index(priority)]++ == 0) mask_[index(priority) / 64] |= bit(priority);
    }
    void remove(int priority) {
      if (--counts_[index(priority)] == 0) mask_[index(priority) / 64] &= ~bit(priority);
    }
    /// Requires 0 <= least <= most.
    [[nodiscard]] bool any(int least, int most) const {
      const std::size_t first = index(least) / 64;
      const std::size_t last = index(most) / 64;
      const std::uint64_t from_least = ~std::uint64_t{0} << (index(least) % 64);
      const std::uint64_t to_most = ~std::uint64_t{0} >> (63 - index(most) % 64);
      if (first == last) return (mask_[first] & from_least & to_most) != 0;
      return (mask_[first] & from_least) != 0 || (mask_[last] & to_most) != 0;
    }

   private:
    static constexpr std::size_t kPriorities = 128;  // SCHED_FIFO has 1 to 99
    [[nodiscard]] static std::size_t index(int priority) { return static_cast<std::size_t>(priority); }
    [[nodiscard]] static std::uint64_t bit(int priority) { return std::uint64_t{1} << (index(priority) % 64); }

    std::array<std::uint32_t, kPriorities> counts_{};
    std::array<std::uint64_t, kPriorities / 64> mask_{};  // two words: any() knows
  };

  std::span<const Change> end_and_place(Thread &self, int priority, bool is_short);
  std::span<const Change> place(Thread &self, int priority, bool is_short);
  [[nodiscard]] bool may_keep(const Thread &self, bool all_run);
  [[nodiscard]] bool overlaps_any(const Thread &self) const;
  [[nodiscard]] static bool overlaps(const Thread &a, const Thread &b) {
    return a.of_job <= b.priority && b.of_job <= a.priority;
  }
  template <class Predicate>
  void lower_raised(Predicate which);
  void enter(Thread &thread);
  void leave(const Thread &thread);
  void set(Thread &thread);

  std::vector<Thread> threads_;
  // The started threads: those with the priority of their job, and those that keep a higher one.
  Counts exact_;
  std::vector<Thread *> raised_;
  std::vector<Change> changes_;
  std::size_t processors_ = 0;
  std::size_t started_ = 0;
  bool unordered_ = false;  // a priority was kept although another job's lies in between
};

/// A thread that is to get another priority.
struct PriorityMove {
  std::size_t thread = 0;
  std::uint32_t level = 0;  // of its job, 0 the most urgent
  int from = 0;
  int to = 0;
};

/// Brings the moves into a sequence after each step of which no thread has a lower priority than one of a less urgent
/// level: rises, the most urgent level first, then falls, the least urgent first. Requires that neither `from` nor `to`
/// increases with the level.
void sort_without_inversion(std::span<PriorityMove> moves);

}  // namespace redag::runtime
