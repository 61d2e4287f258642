// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// SCHED_FIFO priorities of threads that run one job each (0: an ordinary thread). A change is a system call of about 1
// us, and is avoided where possible. A thread that is given a short job keeps a higher priority from its previous job
// while that makes no difference among these threads. A value without threads of its own. Not thread-safe.
#pragma once

#include <cstddef>
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

  // start(), change() and wait() return the required changes, valid until the next call. Nothing allocates.

  /// A thread without a job gets one of this priority.
  std::span<const Change> start(std::size_t thread, int priority, bool is_short);
  /// The thread's job gets another priority.
  std::span<const Change> change(std::size_t thread, int priority);
  void end(std::size_t thread);
  /// A thread without a job waits with this priority. Its next job, if short, does not keep it.
  std::span<const Change> wait(std::size_t thread, int priority);

  /// Returns true if a thread with a job has a real-time priority.
  [[nodiscard]] bool any_realtime() const { return realtime_ > 0; }

 private:
  struct Thread {
    int priority = 0;
    int of_job = 0;  // <= priority while started
    bool started = false;
    bool waited = false;  // it has its priority from wait()
  };

  std::span<const Change> place(Thread &self, int priority, bool is_short);
  void set(Thread &thread);

  std::vector<Thread> threads_;
  std::vector<Change> changes_;
  std::size_t processors_ = 0;
  std::size_t started_ = 0;
  std::size_t realtime_ = 0;  // started threads whose job asks for a real-time priority
  bool unordered_ = false;    // a priority was kept although another job's lies in between
};

}  // namespace redag::runtime
