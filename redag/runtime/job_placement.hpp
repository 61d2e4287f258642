// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Carries out the scheduler's decisions: which thread has which job, and with `os` at which priority. Nothing here
// allocates or looks up names. Not thread-safe: the engine's lock guards it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "redag/runtime/setup.hpp"
#include "redag/runtime/task_table.hpp"
#include "redag/runtime/thread_priorities.hpp"
#include "redag/runtime/worker_pool.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::runtime {

/// The next action of a thread after a decision.
struct Next {
  enum class Kind : std::uint8_t {
    Nothing,  // waits for mail
    Start,    // runs `assignment`
    Resume,   // returns to the job below
  };
  Kind kind = Kind::Nothing;
  Assignment assignment;
};

/// Threads to wake. Real-time threads are woken at once, under the lock: a waker preempted between decision and wake-up
/// would leave an urgent job asleep. As the lock's owner, the waker is raised as soon as the next decision is due.
class WakeUps {
 public:
  explicit WakeUps(bool at_once) : at_once_(at_once) {}
  void wake(WorkerThread &thread) {
    any_ = true;
    if (at_once_ || count_ == late_.size()) {
      thread.parker.unpark();
    } else {
      late_[count_++] = &thread;
    }
  }
  /// Wakes those that could wait for the end of the lock. Call it once.
  void wake_late() {
    for (std::size_t i = 0; i < count_; ++i) late_[i]->parker.unpark();
  }
  [[nodiscard]] bool any() const { return any_; }

 private:
  bool at_once_;
  bool any_ = false;
  std::array<WorkerThread *, 32> late_;
  std::size_t count_ = 0;
};

class JobPlacement {
 public:
  /// os: the kernel schedules the threads by their priorities in `band`.
  JobPlacement(WorkerPool &pool, bool os, const PriorityBand &band);

  /// All threads wait for jobs, on that many processors.
  void start(std::size_t processors);

  /// Carries out a step. `self` is the calling thread if it has just lost its job and can take another. `below` is the
  /// job suspended on it.
  Next place(const sched::Step &step, WorkerThread *self, JobSlot below, TaskTable &tasks, WakeUps &wake_ups);
  /// The thread's topmost job has ended.
  void end(WorkerThread &thread);

  /// Jobs placed and not ended.
  [[nodiscard]] std::uint32_t unfinished() const { return unfinished_; }
  /// Priority changes that the system refused.
  [[nodiscard]] std::uint64_t refused_priorities() const { return refused_priorities_; }

  /// os, throttled: from now on, jobs that are not spared run on ordinary threads, or no longer do so.
  void give_way(bool give_way);
  [[nodiscard]] bool gives_way() const { return giving_way_; }
  /// Returns true if the thread has a job at a real-time priority.
  [[nodiscard]] bool is_realtime(const WorkerThread &thread) const {
    return priorities_.any_realtime() && !thread.stack.empty() && !gives_way(thread);
  }

 private:
  WorkerThread *steal(std::uint32_t level);
  Assignment move_job(WorkerThread &from, WorkerThread &to);
  /// Fills `assignment`, which is the thread's mail or its next action.
  void assign(WorkerThread &thread, const sched::Dispatch &dispatch, TaskEntry &entry, Assignment &assignment);
  /// The thread has mail.
  void post(WorkerThread &thread, WakeUps &wake_ups);
  void change_level(const sched::Dispatch &dispatch, const TaskTable &tasks);
  void set_priority_for_job(WorkerThread &thread, const Assignment &assignment);
  void apply(std::span<const ThreadPriorities::Change> changes);
  /// Returns true if the thread's job is demoted to an ordinary thread, because real-time threads are throttled.
  [[nodiscard]] bool gives_way(const WorkerThread &thread) const { return giving_way_ && !thread.is_spared; }
  [[nodiscard]] int priority_of(const WorkerThread &thread) const {
    return gives_way(thread) ? 0 : band_.of_level(thread.level);
  }

  WorkerPool &pool_;
  bool os_;
  PriorityBand band_;
  ThreadPriorities priorities_;         // os
  std::vector<WorkerThread *> idle_;    // threads without a job; the last one is used first
  std::vector<WorkerThread *> handed_;  // threads that may have mail; each once
  std::uint32_t unfinished_ = 0;
  std::uint64_t refused_priorities_ = 0;
  bool giving_way_ = false;
};

}  // namespace redag::runtime
