// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's own types: its threads, its tasks, its lock. For engine*.cpp only; members say which of them the
// engine's lock guards.
#pragma once

#include <array>
#include <memory>
#include <utility>

#include "redag/runtime/cpu_meter.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::runtime {

inline constexpr std::size_t kNowhere = static_cast<std::size_t>(-1);

struct Engine::TaskEntry {
  static constexpr std::uint32_t kStreak = 8;

  /// Counts a job that ended, used `used` of processor time and took `took` on the clock.
  void count(Duration used, Duration took) {
    short_jobs = took <= CpuMeter::kShort ? std::min(short_jobs + 1, kStreak) : 0;
    ++usage.jobs;
    usage.total += used;
    usage.longest = std::max(usage.longest, used);
    if (wcet > 0 && used > wcet) ++usage.over_wcet;
    if (budget > 0 && used > budget) ++usage.over_budget;
  }

  /// Processor time of the job's next limit, given what was reported before; kNever: none.
  [[nodiscard]] Duration next_limit(const RunningJob &job) const {
    Duration next = kNever;
    if (wcet_low > 0 && !job.used_wcet_low) next = wcet_low;
    if (budget > 0 && (cuts_off || !job.used_budget)) next = std::min(next, budget);
    return next;
  }

  /// Returns true if its jobs are always measured: their limits act at once, or its wcet is below the time charged
  /// without measuring.
  [[nodiscard]] bool always_measured() const {
    return wcet_low > 0 || budget > 0 || (wcet > 0 && wcet < CpuMeter::kShort);
  }
  /// Returns true if its last jobs were short: the next one is expected to be short, too.
  [[nodiscard]] bool expected_short() const { return short_jobs == kStreak && !always_measured(); }

  /// Returns true if a job that has been in progress for `elapsed` is overdue.
  [[nodiscard]] bool is_overdue(Duration elapsed, const WatchLimits &limits) const {
    return (limits.longest > 0 && elapsed > limits.longest) ||
           (limits.deadlines > 0 && deadline > 0 &&
            static_cast<double>(elapsed) > limits.deadlines * static_cast<double>(deadline));
  }

  Body body;
  std::shared_ptr<SkipListener> listener;  // can be null
  Duration wcet = 0;
  Duration wcet_low = 0;
  Duration budget = 0;
  bool cuts_off = false;  // on_budget: abort
  bool is_high = false;   // of a DAG of high criticality
  Usage usage;
  Duration deadline = 0;
  std::shared_ptr<Histogram> response;  // null: not measured
  std::uint64_t late = 0;
  std::uint64_t preemptions = 0;
  std::uint64_t withdrawn = 0;    // jobs skipped by halt()
  std::uint32_t concurrency = 0;  // jobs that can be in progress at once
  std::uint32_t busy = 0;         // jobs that have started and not ended
  std::uint32_t short_jobs = 0;   // consecutive short jobs up to now; at most kStreak
  bool removed = false;
};

struct Engine::Assignment {
  Job job;
  TaskEntry *entry = nullptr;  // keeps its address; its body is not touched while `busy`
  bool expected_short = false;
};

/// The next action of a thread after a decision.
struct Engine::Next {
  enum class Kind : std::uint8_t {
    Nothing,  // waits for mail
    Start,    // runs `assignment`
    Resume,   // returns to the job below
  };
  Kind kind = Kind::Nothing;
  Assignment assignment;
};

struct alignas(64) Engine::Thread {
  Thread(std::uint32_t its_index, std::size_t trace_capacity) : index(its_index), events(trace_capacity) {}

  /// Takes the mail; returns true for one caller only.
  bool take_mail() noexcept {
    return has_mail.load(std::memory_order_relaxed) && has_mail.exchange(false, std::memory_order_acquire);
  }

  std::uint32_t index;
  Parker parker;
  // Written under the lock, by the thread that dispatches, while this thread has no job. Read by the thread that took
  // it: this one, without the lock, or one that steals it before this one is awake, under the lock.
  Assignment mail;
  Atomic<bool> has_mail{false};
  bool is_handed = false;         // lock: is in Engine::handed_
  std::uint32_t level = 0;        // lock: of the job that it was given last; inherited only with `os`
  bool is_realtime = false;       // lock, throttled: had a job at real-time priority at the last look
  bool inherits = false;          // lock: `level` is that of a more urgent job that waits for this thread's job
  Atomic<bool> outranked{false};  // written under the lock
  std::vector<Job> stack;         // lock: the jobs started here, the running one last
  trace::Ring events;             // Started and Executed; written by the thread
  CpuMeter meter;                 // used by the thread only
  // The topmost job whose body the thread is in; null once the body has returned. Written by the thread. What it points
  // to stays valid under the lock, because a job's end takes the lock after clearing this.
  Atomic<RunningJob *> top{nullptr};

  ThreadHandle handle;
  clockid_t cpu_clock = 0;            // of `handle`; set before the engine runs
  ProcessorWord processor = nullptr;  // lock: of `handle`, while the engine runs
};

/// The throttling guard: a thread that checks how much the kernel leaves to real-time threads.
struct Engine::ShareKeeper {
  Parker parker;
  ThreadHandle handle;
};

/// Holds the engine's lock. Wakes threads and reports skips after releasing it. Real-time threads are woken under the
/// lock instead: a waker preempted between decision and wake-up would leave an urgent job asleep. As the lock's owner,
/// the waker is raised as soon as the next decision is due.
class REDAG_SCOPED_CAPABILITY Engine::Locked {
 public:
  explicit Locked(Engine &engine) REDAG_ACQUIRE(engine.lock_) : engine_(engine) { engine_.lock_.lock(); }
  /// For `releases` releases. Each can skip a ready job and one that waits for its predecessors. Allocates room for
  /// these skips before it takes the lock.
  Locked(Engine &engine, std::size_t releases) REDAG_ACQUIRE(engine.lock_) : engine_(engine) {
    if (2 * releases > kFewSkips && engine_.has_listeners_.load(std::memory_order_relaxed)) {
      more_skips_.reserve(2 * releases - kFewSkips);
    }
    engine_.lock_.lock();
  }
  ~Locked() REDAG_RELEASE() {
    engine_.lock_.unlock();
    for (std::size_t i = 0; i < count_; ++i) late_[i]->parker.unpark();
    for (std::size_t i = 0; i < skip_count_; ++i) {
      few_skips_[i].listener->skipped(few_skips_[i].reason);
      std::destroy_at(&few_skips_[i]);
    }
    for (const Skip &skip : more_skips_) skip.listener->skipped(skip.reason);
  }
  Locked(const Locked &) = delete;
  Locked &operator=(const Locked &) = delete;

  /// Allocates only if one decision skips more than kFewSkips jobs (HI mode begins).
  void tell(std::shared_ptr<SkipListener> listener, Reason reason) {
    if (skip_count_ < kFewSkips) {
      std::construct_at(&few_skips_[skip_count_++], Skip{std::move(listener), reason});
    } else {
      more_skips_.push_back(Skip{std::move(listener), reason});
    }
  }
  /// Drops the skips: the caller itself reported them as missed.
  void tell_nobody() {
    std::destroy_n(few_skips_, skip_count_);
    skip_count_ = 0;
    more_skips_.clear();
  }

  void wake(Thread &thread) {
    if (engine_.realtime() || count_ == late_.size()) {
      thread.parker.unpark();
    } else {
      late_[count_++] = &thread;
    }
  }

 private:
  Engine &engine_;
  struct Skip {
    std::shared_ptr<SkipListener> listener;
    Reason reason = Reason::None;
  };
  static constexpr std::size_t kFewSkips = 8;
  union {
    // Only the first skip_count_ are constructed; the others cost nothing.
    Skip few_skips_[kFewSkips];  // NOLINT(readability-identifier-naming): a private member, of a union without a name
  };
  std::size_t skip_count_ = 0;
  std::vector<Skip> more_skips_;
  std::array<Thread *, 32> late_;
  std::size_t count_ = 0;
};

}  // namespace redag::runtime
