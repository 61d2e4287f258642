// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/job_placement.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::runtime {

using sched::Dispatch;
using sched::DispatchKind;

JobPlacement::JobPlacement(WorkerPool &pool, WaitingJobs &waiting, bool os, const PriorityBand &band, Parker *lookout,
                           std::uint32_t spare)
    : pool_(pool),
      waiting_(waiting),
      os_(os),
      band_(band),
      priorities_(os ? pool.size() : 0, band.top_job),
      mailboxes_(pool.size(), lookout, !os && pool.size() > 1),
      spare_(spare),
      of_leader_(band_.timer) {
  moves_.reserve(os ? pool.size() : 0);
}

void JobPlacement::start(std::size_t processors) {
  priorities_.set_processors(processors);
  mailboxes_.set_processors(processors);
  const auto &threads = pool_.threads();
  for (auto thread = threads.rbegin(); thread != threads.rend(); ++thread) add_idle(**thread, false);
}

// Threads are alike: any idle thread gets the job. A job that is suspended under others stays on its thread. In `os`
// mode the kernel decides by priority which job really runs, and a preempted job needs no action. The taker takes the
// most urgent job to start. Therefore none of the threads that it wakes preempts it under the lock.
void JobPlacement::place(const sched::Step &step, const Situation &situation, Taker *taker, TaskTable &tasks,
                         WakeUps &wake_ups) {
  const bool have_levels = os_ && step.dispatches.size() > 1 && change_several_levels(step);
  const Dispatch *own = taker == nullptr ? nullptr : serve(*taker, step, situation, tasks);
  for (const Dispatch &dispatch : step.dispatches) {
    if (&dispatch == own) continue;
    if (!needs_thread(dispatch)) {
      if (dispatch.kind == DispatchKind::Serve) {
        waiting_.serve(dispatch.job, os_ ? band_.of_level(waiting_.find(dispatch.job)->level) : 0, situation.now);
        continue;
      }
      if (const WaitingJob *woken = find_woken(dispatch)) {
        if (taker != nullptr && taker->below.valid() && dispatch.over == taker->below) yield(*taker);
        end_lending(*woken->thread, dispatch, wake_ups);
        continue;
      }
      if (dispatch.kind == DispatchKind::Resume) {
        if (taker != nullptr && dispatch.job == taker->below) {
          taker->next.kind = Next::Kind::Resume;
        } else if (yielding_ > 0) {
          end_yield(dispatch.job, wake_ups);
        }
      }
      if (os_ && !have_levels) change_level(dispatch);
      continue;
    }
    TaskEntry &entry = tasks[dispatch.task];
    // A thread that wakes up on the caller's processor, and preempts it, is there much sooner than one elsewhere. The
    // caller would have to wait for a longer job, although another processor may be idle.
    const bool preempts = os_ && taker == nullptr && entry.expected_short();
    const int here = preempts ? processor_of(this_threads_processor()) : -1;
    const Sender sender = may_wait_for(situation.sender, dispatch.level) ? situation.sender : nullptr;
    mailboxes_.post(entry, situation.now, here, sender, wake_ups, [&](WorkerThread &thread) {
      assign(thread, dispatch, entry, thread.mail);
      set_priority_for_job(thread, thread.mail);
    });
  }
  mailboxes_.settle(wake_ups);
}

// Gives the taker its next job, or adds it to the idle threads. Returns the decision that it thereby carries out, or
// null.
const Dispatch *JobPlacement::serve(Taker &taker, const sched::Step &step, const Situation &situation,
                                    TaskTable &tasks) {
  WorkerThread &self = taker.thread;
  const bool is_caller = &self == &pool_.caller();
  taker.next.kind = Next::Kind::Nothing;
  const Dispatch *own = choose_own(step, taker.below);
  if (taker.takes_any && own != nullptr && mailboxes_.should_leave(tasks[own->task], situation.waited)) {
    add_idle(self, situation.may_lead);
    return nullptr;
  }
  if (taker.takes_any) {
    // In `os` mode a thread steals only if it would be idle: two threads that exchange jobs must exchange priorities.
    const std::uint32_t above = own == nullptr ? sched::kNoLimit : (os_ ? 0 : own->level);
    if (WorkerThread *other = mailboxes_.steal(above)) {
      move_job(*other, self, situation.may_lead, taker.next.assignment);
      taker.next.kind = Next::Kind::Start;
      mailboxes_.begin(self, *taker.next.assignment.entry);
      return nullptr;
    }
    if (own == nullptr) add_idle(self, situation.may_lead);
  }
  if (own == nullptr) return nullptr;
  TaskEntry &entry = tasks[own->task];
  taker.next.kind = Next::Kind::Start;
  assign(self, *own, entry, taker.next.assignment);
  if (!is_caller) set_priority_for_job(self, taker.next.assignment);
  if (taker.takes_any) mailboxes_.begin(self, entry);
  return own;
}

// Chooses the job that the calling thread runs: the one on top of the job below, or the most urgent of all.
const Dispatch *JobPlacement::choose_own(const sched::Step &step, JobSlot below) const {
  const Dispatch *own = nullptr;
  for (const Dispatch &dispatch : step.dispatches) {
    if (!needs_thread(dispatch) || (below.valid() && dispatch.over != below)) continue;
    if (own == nullptr || dispatch.level < own->level) own = &dispatch;
  }
  return own;
}

void JobPlacement::leave(WorkerThread &thread) {
  thread.stack.pop_back();
  mailboxes_.end(thread);
  if (os_ && &thread != &pool_.caller()) priorities_.end(thread.index);
}

// The thread has the job from now on.
WaitingJob &JobPlacement::take_woken(WorkerThread &thread, const Dispatch &dispatch) {
  WaitingJob &job = *waiting_.find(dispatch.job);
  waiting_.remove(dispatch.job);
  job.job.worker = dispatch.worker;
  thread.level = dispatch.level;
  return job;
}

void JobPlacement::fill_woken(WorkerThread &thread, const Dispatch &dispatch, const TaskEntry &entry,
                              Assignment &assignment) {
  WaitingJob &job = take_woken(thread, dispatch);
  assignment.job = job.job;
  assignment.entry = job.entry;
  assignment.woken = &job;
  assignment.expected_short = entry.expected_short();
}

void JobPlacement::end_lending(WorkerThread &thread, const Dispatch &dispatch, WakeUps &wake_ups) {
  WaitingJob &job = take_woken(thread, dispatch);
  job.thread = nullptr;
  thread.stack.push_back(job.job);
  --blocking_;
  if (os_) apply(priorities_.start(thread.index, priority_of(thread), false));
  thread.goes_on.store(true, std::memory_order_release);
  wake_ups.wake(thread);
}

// With `os`, the leader is above all jobs of the engine while it waits, as the release thread is.
void JobPlacement::add_idle(WorkerThread &thread, bool may_lead) {
  const bool leads = mailboxes_.add_idle(thread, may_lead);
  if (os_ && leads) apply(priorities_.wait(thread.index, of_leader_));
}

void JobPlacement::move_job(WorkerThread &from, WorkerThread &to, bool may_lead, Assignment &assignment) {
  assignment = from.mail;
  to.stack.push_back(from.stack.back());
  from.stack.pop_back();
  to.level = from.level;
  if (os_) priorities_.end(from.index);
  set_priority_for_job(to, assignment);
  add_idle(from, may_lead);
}

// The job on the taker's thread is preempted by one that goes on on a thread of its own.
void JobPlacement::yield(Taker &taker) {
  taker.next.kind = Next::Kind::Yield;
  taker.thread.yields = true;
  ++yielding_;
}

void JobPlacement::end_yield(JobSlot job, WakeUps &wake_ups) {
  for (const auto &thread : pool_.threads()) {
    if (!thread->yields || thread->stack.back().slot != job) continue;
    thread->yields = false;
    --yielding_;
    thread->goes_on.store(true, std::memory_order_release);
    wake_ups.wake(*thread);
    return;
  }
}

// Started jobs get new levels together where a task or a DAG has come, gone or changed, or HI mode begins. Returns true
// if that was done: one after the other, two threads could be in the wrong order for a moment.
bool JobPlacement::change_several_levels(const sched::Step &step) {
  const auto changes = [](const Dispatch &dispatch) { return dispatch.kind == DispatchKind::Level; };
  if (std::count_if(step.dispatches.begin(), step.dispatches.end(), changes) < 2) return false;
  for (const Dispatch &dispatch : step.dispatches) {
    if (changes(dispatch) || (dispatch.kind == DispatchKind::Resume && !needs_thread(dispatch))) {
      static_cast<void>(set_level(dispatch));
    }
  }
  follow_levels();
  return true;
}

// Returns the thread that has the job. Null: the job waits, for example for a device, which will serve it at this
// level, or it runs at the priority of the thread that called run_one().
WorkerThread *JobPlacement::set_level(const Dispatch &dispatch) {
  if (WaitingJob *const waiting = waiting_.find(dispatch.job)) {
    waiting->level = dispatch.level;
    return nullptr;
  }
  const auto runs_it = [&](const WorkerThread &t) { return !t.stack.empty() && t.stack.back().slot == dispatch.job; };
  if (runs_it(pool_.caller())) return nullptr;
  const auto thread = std::find_if(pool_.threads().begin(), pool_.threads().end(),
                                   [&](const auto &candidate) { return runs_it(*candidate); });
  REDAG_CHECK(thread != pool_.threads().end(), "a job goes on that no thread has");
  (*thread)->level = dispatch.level;
  return thread->get();
}

void JobPlacement::change_level(const Dispatch &dispatch) {
  const WorkerThread *const thread = set_level(dispatch);
  if (thread != nullptr) apply(priorities_.change(thread->index, priority_of(*thread)));
}

// The job of a thread is followed by this one.
void JobPlacement::move_priority(WorkerThread &thread, const Assignment &assignment) {
  apply(priorities_.follow(thread.index, priority_of(thread), keeps_priority(assignment)));
}

void JobPlacement::set_priority_for_job(WorkerThread &thread, const Assignment &assignment) {
  if (os_) apply(priorities_.start(thread.index, priority_of(thread), keeps_priority(assignment)));
}

void JobPlacement::apply(std::span<const ThreadPriorities::Change> changes) {
  for (const ThreadPriorities::Change &change : changes) {
    if (!set_fifo_priority(pool_[change.thread].handle.native_handle(), change.priority)) ++refused_priorities_;
  }
}

void JobPlacement::set_leader(int priority) {
  of_leader_ = priority;
  if (pool_.ending()) return;  // threads may have been joined
  for (const auto &thread : pool_.threads()) {
    if (thread->stack.empty() && thread->leads.load(std::memory_order_relaxed)) {
      apply(priorities_.wait(thread->index, of_leader_));
    }
  }
}

void JobPlacement::follow_levels() {
  moves_.clear();
  for (const auto &thread : pool_.threads()) {
    if (thread->stack.empty()) continue;
    moves_.push_back({thread->index, thread->level, priorities_.of(thread->index), priority_of(*thread)});
  }
  sort_without_inversion(moves_);
  for (const PriorityMove &move : moves_) apply(priorities_.change(move.thread, move.to));
}

}  // namespace redag::runtime
