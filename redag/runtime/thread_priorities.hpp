// SCHED_FIFO priorities of threads that run one job each, changed as seldom as can be: a change is a system call of
// about 1 us. A thread that is given a short job keeps a higher priority which it has from the job before where that
// makes no difference among these threads, until it does. A value, without threads of its own.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/base/check.hpp"

namespace redag::runtime {

class ThreadPriorities {
 public:
  /// Threads of that priority, none of which has a job.
  ThreadPriorities(std::size_t threads, int priority) : threads_(threads, Thread{priority, 0, false}) {}

  /// While no more jobs are started than that, each has a processor and their order does not matter.
  void set_processors(std::size_t processors) { processors_ = processors; }

  /// A thread without a job gets one. `apply(thread, priority)` is called for every change.
  template <class Apply>
  void start(std::size_t thread, int priority, bool is_short, Apply &&apply) {
    Thread &self = threads_[thread];
    REDAG_CHECK(!self.started, "a thread has two jobs");
    self.started = true;
    ++started_;
    place(self, priority, is_short, apply);
  }
  /// Its job gets another priority.
  template <class Apply>
  void change(std::size_t thread, int priority, Apply &&apply) {
    place(threads_[thread], priority, false, apply);
  }
  void end(std::size_t thread) {
    threads_[thread].started = false;
    --started_;
  }

  [[nodiscard]] int priority(std::size_t thread) const { return threads_[thread].priority; }

 private:
  struct Thread {
    int priority = 0;
    int of_job = 0;  // <= priority while started
    bool started = false;
  };

  template <class Apply>
  void place(Thread &self, int priority, bool is_short, Apply &apply) {
    self.of_job = priority;
    const bool all_run = started_ <= processors_;
    if (unordered_ && !all_run) {
      for (Thread &thread : threads_) {
        if (thread.started) set(thread, apply);
      }
      unordered_ = false;
      return;
    }
    // Threads whose order with this one is not the order of their jobs, or not for any job in between.
    const auto overlaps = [&self](const Thread &other) {
      return &other != &self && other.started && other.of_job <= self.priority && self.of_job <= other.priority;
    };
    if (is_short && self.priority > self.of_job) {
      const bool ordered = std::none_of(threads_.begin(), threads_.end(), overlaps);
      if (ordered) return;
      if (all_run) {
        unordered_ = true;
        return;
      }
    }
    set(self, apply);
    for (Thread &thread : threads_) {
      if (overlaps(thread)) set(thread, apply);
    }
  }

  template <class Apply>
  void set(Thread &thread, Apply &apply) {
    if (thread.priority == thread.of_job) return;
    thread.priority = thread.of_job;
    apply(static_cast<std::size_t>(&thread - threads_.data()), thread.priority);
  }

  std::vector<Thread> threads_;
  std::size_t processors_ = 0;
  std::size_t started_ = 0;
  bool unordered_ = false;  // kept a priority although another job's lies in between
};

}  // namespace redag::runtime
