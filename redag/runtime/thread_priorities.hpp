// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// SCHED_FIFO priorities of threads that run one job each (0: an ordinary thread), changed as seldom as can be: a change
// is a system call of about 1 us. A thread that is given a short job keeps a higher priority which it has from the job
// before where that makes no difference among these threads, until it does. A value, without threads of its own.
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

  /// Threads of that priority, none of which has a job.
  ThreadPriorities(std::size_t threads, int priority);

  /// While no more jobs are started than that, each has a processor and their order does not matter.
  void set_processors(std::size_t processors) { processors_ = processors; }

  // The next two return what has to be changed; valid until the next call. Nothing allocates.

  /// A thread without a job gets one.
  std::span<const Change> start(std::size_t thread, int priority, bool is_short);
  /// Its job gets another priority.
  std::span<const Change> change(std::size_t thread, int priority);
  void end(std::size_t thread);

  /// Has a thread with a job a priority?
  [[nodiscard]] bool any_realtime() const { return realtime_ > 0; }

 private:
  struct Thread {
    int priority = 0;
    int of_job = 0;  // <= priority while started
    bool started = false;
  };

  std::span<const Change> place(Thread &self, int priority, bool is_short);
  void set(Thread &thread);

  std::vector<Thread> threads_;
  std::vector<Change> changes_;
  std::size_t processors_ = 0;
  std::size_t started_ = 0;
  std::size_t realtime_ = 0;  // of them; what their jobs ask for counts
  bool unordered_ = false;    // a priority was kept although another job's lies in between
};

}  // namespace redag::runtime
