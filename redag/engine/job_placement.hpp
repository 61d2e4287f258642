// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Carries out the scheduler's decisions: which thread has which job, and with `os` at which priority. Nothing here
// allocates or looks up names. Not thread-safe: the engine's lock guards it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/engine/mailboxes.hpp"
#include "redag/engine/task_table.hpp"
#include "redag/engine/waiting_jobs.hpp"
#include "redag/engine/worker_pool.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/threads/setup.hpp"
#include "redag/threads/thread_priorities.hpp"

namespace redag::runtime {

/// The next action of a thread after a decision.
struct Next {
  enum class Kind : std::uint8_t {
    Nothing,  // waits for mail
    Start,    // runs `assignment`
    Resume,   // returns to the job below
    Yield,    // keeps the job below, which a job on another thread has preempted: waits until that one is done
  };
  Kind kind = Kind::Nothing;
  Assignment assignment;
};

/// A thread that has lost its job and can take another.
struct Taker {
  WorkerThread &thread;
  JobSlot below;   // the job that is suspended on it
  bool takes_any;  // it can have any job next: none is suspended on it, and it is one of the pool's
  Next next = {};
};

/// What a decision is placed under.
struct Situation {
  Time now = 0;             // when it was taken
  bool waited = false;      // the calling thread waited for the engine's lock
  bool may_lead = false;    // releases are expected: an idle thread can wait for them
  Sender sender = nullptr;  // it releases the jobs from its body, and may take one of them at its end
};

class JobPlacement {
 public:
  /// os: the kernel schedules the threads by their priorities in `band`. For `lookout` see Mailboxes; `os` leaves
  /// tiny jobs to their own threads.
  /// `spare`: how many threads there are besides those that can have jobs with a worker.
  JobPlacement(WorkerPool &pool, WaitingJobs &waiting, bool os, const PriorityBand &band, Parker *lookout,
               std::uint32_t spare);

  /// All threads wait for jobs, on that many processors.
  void start(std::size_t processors);

  /// Carries out a step. `taker` is the calling thread, or null if it cannot take a job.
  void place(const sched::Step &step, const Situation &situation, Taker *taker, TaskTable &tasks, WakeUps &wake_ups);
  /// Tries to carry out a step that a thread took at the end of its job, in less time than end() and place() take. This
  /// is for the usual case: one job starts, and the thread begins it. `waited`: it waited for the engine's lock.
  /// Returns false in all other cases, in which end() and place() are to be called.
  bool hand_over(Taker &taker, const sched::Step &step, TaskTable &tasks, bool waited) {
    if (step.dispatches.size() != 1 || !taker.takes_any) return false;
    const sched::Dispatch &next = step.dispatches.front();
    if (next.kind != sched::DispatchKind::Start) return false;
    // With `os` a thread that has a job of its own steals none, but silent mail has to wake its thread.
    if (os_ ? mailboxes_.any_silent() : !mailboxes_.all_empty()) return false;
    WorkerThread &self = taker.thread;
    TaskEntry &entry = tasks[next.task];
    mailboxes_.end(self);
    if (mailboxes_.should_leave(entry, waited)) return false;
    fill(self, next, entry, taker.next.assignment);
    self.stack.back() = taker.next.assignment.job;
    if (os_) move_priority(self, taker.next.assignment);
    mailboxes_.begin(self, entry);
    return true;
  }
  /// The thread's topmost job has ended.
  void end(WorkerThread &thread) {
    leave(thread);
    --unfinished_;
  }
  /// The thread's topmost job waits. It is among the waiting jobs until it has a thread again.
  void leave(WorkerThread &thread);
  /// The thread's topmost job blocks. It is among the waiting jobs until it has a worker again. Returns false, and
  /// changes nothing, if that would leave too few threads for the jobs that have workers. A job that blocked and goes
  /// on over another one leaves that one waiting on its thread: each spare thread has one of either kind.
  [[nodiscard]] bool lend(WorkerThread &thread) {
    if (blocking_ + yielding_ >= spare_) return false;
    ++blocking_;
    leave(thread);
    return true;
  }

  bool defer(Time now, WakeUps &wake_ups) { return mailboxes_.defer(now, wake_ups); }
  [[nodiscard]] bool take_deferred() { return mailboxes_.take_deferred(); }
  /// For the lookout: returns true if it should look again.
  bool look(WakeUps &wake_ups) { return mailboxes_.look(wake_ups); }

  /// Jobs placed and not ended, also those that wait.
  [[nodiscard]] std::uint32_t unfinished() const { return unfinished_; }
  /// Priority changes that the system refused.
  [[nodiscard]] std::uint64_t refused_priorities() const { return refused_priorities_; }
  void count_refused() { ++refused_priorities_; }

  /// os: the priorities of the levels from now on, most urgent first. Threads that have jobs keep theirs until
  /// follow_levels(), or until the scheduler tells new levels.
  void set_levels(std::vector<int> priorities) { band_.given = std::move(priorities); }
  /// os: gives the threads that have jobs the priorities of their levels. Meanwhile no two are in another order than
  /// before and after.
  void follow_levels();
  /// os: the priority of the leader while it waits, in the place of the release thread.
  void set_leader(int priority);
  [[nodiscard]] int of_leader() const { return of_leader_; }
  /// os: the priority of threads that release jobs, as it follows from the levels.
  [[nodiscard]] int of_releases() const { return band_.of_releases(); }
  /// os: the priority of a job with this level.
  [[nodiscard]] int priority_of_level(std::uint32_t level) const { return band_.of_level(level); }

 private:
  /// Returns true if the job needs a thread: it starts, or it has waited and goes on.
  [[nodiscard]] bool needs_thread(const sched::Dispatch &dispatch) const {
    if (dispatch.kind == sched::DispatchKind::Start) return true;
    const WaitingJob *woken = find_woken(dispatch);
    return woken != nullptr && woken->thread == nullptr;
  }
  /// Returns the job if it has waited and goes on, or null.
  [[nodiscard]] WaitingJob *find_woken(const sched::Dispatch &dispatch) const {
    return dispatch.kind == sched::DispatchKind::Resume ? waiting_.find(dispatch.job) : nullptr;
  }
  const sched::Dispatch *choose_own(const sched::Step &step, JobSlot below) const;
  const sched::Dispatch *serve(Taker &taker, const sched::Step &step, const Situation &situation, TaskTable &tasks);
  void add_idle(WorkerThread &thread, bool may_lead);
  // `assignment`, which these fill, is the thread's mail or its next action.
  void move_job(WorkerThread &from, WorkerThread &to, bool may_lead, Assignment &assignment);
  void assign(WorkerThread &thread, const sched::Dispatch &dispatch, TaskEntry &entry, Assignment &assignment) {
    if (dispatch.kind == sched::DispatchKind::Start) {
      fill(thread, dispatch, entry, assignment);
      ++unfinished_;
    } else {
      fill_woken(thread, dispatch, entry, assignment);
    }
    thread.stack.push_back(assignment.job);
  }
  void fill_woken(WorkerThread &thread, const sched::Dispatch &dispatch, const TaskEntry &entry,
                  Assignment &assignment);
  WaitingJob &take_woken(WorkerThread &thread, const sched::Dispatch &dispatch);
  void end_lending(WorkerThread &thread, const sched::Dispatch &dispatch, WakeUps &wake_ups);
  static void fill(WorkerThread &thread, const sched::Dispatch &dispatch, TaskEntry &entry, Assignment &assignment) {
    REDAG_CHECK(entry.busy < entry.concurrency, "more jobs of one task at a time than it allows");
    ++entry.busy;
    assignment.job = {.task = dispatch.task,
                      .number = dispatch.number,
                      .release = dispatch.release,
                      .origin = dispatch.origin,
                      .slot = dispatch.job,
                      .worker = dispatch.worker};
    assignment.entry = &entry;
    assignment.woken = nullptr;
    assignment.expected_short = entry.expected_short();
    thread.level = dispatch.level;
  }
  void yield(Taker &taker);
  void end_yield(JobSlot job, WakeUps &wake_ups);
  bool change_several_levels(const sched::Step &step);
  WorkerThread *set_level(const sched::Dispatch &dispatch);
  void change_level(const sched::Dispatch &dispatch);
  void set_priority_for_job(WorkerThread &thread, const Assignment &assignment);
  void move_priority(WorkerThread &thread, const Assignment &assignment);
  /// A thread with a short job may keep a higher priority from its previous one, but not where jobs of other processes
  /// can have a priority in between.
  [[nodiscard]] bool keeps_priority(const Assignment &assignment) const {
    return assignment.expected_short && !band_.shared;
  }
  void apply(std::span<const ThreadPriorities::Change> changes);
  [[nodiscard]] int priority_of(const WorkerThread &thread) const { return band_.of_level(thread.level); }

  WorkerPool &pool_;
  WaitingJobs &waiting_;
  bool os_;
  PriorityBand band_;
  ThreadPriorities priorities_;  // os
  Mailboxes mailboxes_;
  std::vector<PriorityMove> moves_;  // of follow_levels()
  const std::uint32_t spare_;
  std::uint32_t blocking_ = 0;  // jobs that block, each on its thread
  std::uint32_t yielding_ = 0;  // threads that wait after Next::Kind::Yield
  std::uint32_t unfinished_ = 0;
  std::uint64_t refused_priorities_ = 0;
  int of_leader_;  // os: its priority while it waits
};

}  // namespace redag::runtime
