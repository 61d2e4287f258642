// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Carries out the scheduler's decisions. Everything here runs under the engine's lock, allocates nothing, and looks up
// no names.
#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/runtime/engine_parts.hpp"

namespace redag::runtime {

using sched::Dispatch;

// `self` is the calling thread if it has just lost its job and can take another. `below` is the job suspended on it.
Engine::Next Engine::decide(Locked &locked, Time now, Thread *self, JobSlot below) {
  // While paused, only run_one() starts a job, on the caller's thread.
  const std::uint32_t for_caller = self == caller_.get() ? 1 : 0;
  const sched::Step step = scheduler_->dispatch(now, may_start() ? sched::kNoLimit : for_caller);
  if (options_.trace_capacity > 0) {
    for (const JobEvent &event : step.events) decisions_.push(event);
  }
  if (options_.measure) {
    for (const JobEvent &event : step.events) {
      if (event.kind == JobEventKind::Preempted) ++tasks_[event.task.value].preemptions;
    }
  }
  if (has_listeners_.load(std::memory_order_relaxed)) {
    for (const JobEvent &event : step.events) {
      const auto &listener = tasks_[event.task.value].listener;
      if (event.kind == JobEventKind::Skipped && listener) locked.tell(listener, event.reason);
    }
  }
  const bool shares = share_ && can_give_way();
  if (shares && !share_is_kept_ && (unfinished_ > 0 || !step.dispatches.empty())) {
    // Wakes the throttling guard before any job: a job above the calling thread may delay everything that follows. The
    // guard is above all jobs and waits for the lock. Its owner is raised meanwhile, and no job preempts it.
    share_is_kept_ = true;
    share_keeper_->parker.unpark();
  }
  const Next next = place(locked, step, self, below);
  if (options_.config.preemption == sched::Preemption::Cooperative) refresh_outranked();
  if (shares) {
    note_where_realtime_ran();
    set_realtime_busy(now);
  }
  return next;
}

// Threads are alike: any idle thread gets the job. A job that is suspended under others stays on its thread. In `os`
// mode the kernel decides by priority which job really runs, and the engine does nothing to a preempted job. The
// calling thread takes the most urgent job to start. Therefore none of the threads that it wakes preempts it under the
// lock.
Engine::Next Engine::place(Locked &locked, const sched::Step &step, Thread *self, JobSlot below) {
  const bool is_caller = self == caller_.get();
  const Dispatch *own = self == nullptr ? nullptr : choose_own(step, below);
  Next next;
  if (self != nullptr && !below.valid() && !is_caller) {
    // In `os` mode a thread steals only if it would be idle: two threads that exchange jobs must exchange priorities.
    const std::uint32_t above = own == nullptr ? sched::kNoLimit : (os() ? 0 : own->level);
    if (Thread *other = steal(above)) {
      next = Next{Next::Kind::Start, move_job(*other, *self)};
      own = nullptr;
    } else if (own == nullptr) {
      idle_.push_back(self);
    }
  }
  if (own != nullptr) {
    next = Next{Next::Kind::Start, assign(*self, *own)};
    if (!is_caller) set_priority_for_job(*self, next.assignment);
  }
  for (const Dispatch &dispatch : step.dispatches) {
    if (&dispatch == own) continue;
    if (dispatch.kind != sched::DispatchKind::Start) {
      if (dispatch.kind == sched::DispatchKind::Resume && dispatch.job == below) next.kind = Next::Kind::Resume;
      if (os()) change_level(dispatch);
      continue;
    }
    REDAG_CHECK(!idle_.empty(), "more jobs started than there are threads");
    Thread &thread = *idle_.back();
    idle_.pop_back();
    const Assignment assignment = assign(thread, dispatch);
    set_priority_for_job(thread, assignment);
    post(locked, thread, assignment);
  }
  return next;
}

// Chooses the job that the calling thread starts: the one on top of the job below, or the most urgent of all.
const Dispatch *Engine::choose_own(const sched::Step &step, JobSlot below) {
  const Dispatch *own = nullptr;
  for (const Dispatch &dispatch : step.dispatches) {
    if (dispatch.kind != sched::DispatchKind::Start || (below.valid() && dispatch.over != below)) continue;
    if (own == nullptr || dispatch.level < own->level) own = &dispatch;
  }
  return own;
}

// Steals the job of a thread that is not awake yet, if that job is above `level`; waking it takes longer than most
// jobs. Returns that thread, or null. The thread then finds no mail.
Engine::Thread *Engine::steal(std::uint32_t level) {
  Thread *victim = nullptr;
  for (std::size_t i = 0; i < handed_.size();) {
    Thread &thread = *handed_[i];
    if (!thread.has_mail.load(std::memory_order_relaxed)) {
      thread.is_handed = false;
      handed_[i] = handed_.back();
      handed_.pop_back();
      continue;
    }
    if (thread.level < level) {
      victim = &thread;
      level = thread.level;
    }
    ++i;
  }
  return victim != nullptr && victim->take_mail() ? victim : nullptr;
}

Engine::Assignment Engine::move_job(Thread &from, Thread &to) {
  const Assignment assignment = from.mail;
  to.stack.push_back(from.stack.back());
  from.stack.pop_back();
  to.level = from.level;
  to.inherits = from.inherits;
  if (os()) priorities_.end(from.index);
  set_priority_for_job(to, assignment);
  idle_.push_back(&from);
  return assignment;
}

void Engine::set_priority_for_job(Thread &thread, const Assignment &assignment) {
  if (!os()) return;
  // A demoted thread must not keep the priority of its previous job.
  const bool is_short = assignment.expected_short && !gives_way(thread);
  apply(priorities_.start(thread.index, priority_of(thread), is_short));
}

// Returns true if the thread's job is demoted to an ordinary thread, because real-time threads are throttled. Spares
// jobs of DAGs of high criticality and jobs for which a more urgent one waits.
bool Engine::gives_way(const Thread &thread) const {
  return giving_way_ && !thread.inherits && !tasks_[thread.stack.back().task.value].is_high;
}

int Engine::priority_of(const Thread &thread) const {
  return gives_way(thread) ? 0 : options_.band.of_level(thread.level);
}

// Returns the index in `share_` of the processor where the thread runs or ran last; kNowhere: unknown.
std::size_t Engine::place_of(const Thread &thread) const {
  const int cpu = processor_of(thread.processor);
  return cpu < 0 || static_cast<std::size_t>(cpu) >= share_places_.size()
             ? kNowhere
             : share_places_[static_cast<std::size_t>(cpu)];
}

// The kernel chooses where threads run, and moves them only when a thread begins or stops to run. A thread is charged
// where two consecutive looks find it; each decision is a look.
void Engine::note_where_realtime_ran() {
  for (const auto &thread : threads_) {
    if (!thread->is_realtime) continue;
    const std::size_t place = place_of(*thread);
    if (place == kNowhere) {
      share_->ran_everywhere();
      return;
    }
    share_->ran_on(place);
  }
}

void Engine::set_realtime_busy(Time now) {
  bool anywhere = false;
  std::fill(realtime_on_.begin(), realtime_on_.end(), false);
  for (const auto &thread : threads_) {
    thread->is_realtime = priorities_.any_realtime() && !thread->stack.empty() && !gives_way(*thread);
    if (!thread->is_realtime || thread->has_mail.load(std::memory_order_relaxed)) continue;  // not awake yet
    const std::size_t place = place_of(*thread);
    anywhere = anywhere || place == kNowhere;
    if (place != kNowhere) realtime_on_[place] = true;
  }
  if (anywhere || realtime_on_.empty()) {
    share_->set_busy(anywhere, now);
  } else {
    share_->set_busy(realtime_on_, now);
  }
}

// Returns the time until the next look; kNever: not before the guard is woken.
Duration Engine::look_at_share() {
  const Time at = now();
  Locked locked(*this);
  note_where_realtime_ran();
  const bool give_way = share_->used_up(at) && can_give_way();
  if (give_way != giving_way_) {
    if (giving_way_) gave_way_ += std::max<Duration>(0, at - giving_way_since_);
    giving_way_ = give_way;
    giving_way_since_ = at;
    for (const auto &thread : threads_) {
      if (!thread->stack.empty()) apply(priorities_.change(thread->index, priority_of(*thread)));
    }
  }
  set_realtime_busy(at);
  share_is_kept_ = giving_way_ || (unfinished_ > 0 && can_give_way());
  return share_is_kept_ ? share_->until_change() : kNever;
}

void Engine::change_level(const Dispatch &dispatch) {
  const auto runs_it = [&](const auto &t) { return !t->stack.empty() && t->stack.back().slot == dispatch.job; };
  if (runs_it(caller_)) return;  // runs at its own priority
  const auto thread = std::find_if(threads_.begin(), threads_.end(), runs_it);
  REDAG_CHECK(thread != threads_.end(), "a job goes on that no thread has");
  (*thread)->level = dispatch.level;
  (*thread)->inherits = dispatch.inherits;
  apply(priorities_.change((*thread)->index, priority_of(**thread)));
}

Engine::Assignment Engine::assign(Thread &thread, const Dispatch &dispatch) {
  TaskEntry &entry = tasks_[dispatch.task.value];
  REDAG_CHECK(entry.busy < entry.concurrency, "more jobs of one task at a time than it allows");
  ++entry.busy;
  ++unfinished_;
  const Job job{dispatch.task, dispatch.number, dispatch.release, dispatch.job, dispatch.worker};
  thread.stack.push_back(job);
  thread.level = dispatch.level;
  thread.inherits = dispatch.inherits;
  return Assignment{job, &entry, entry.expected_short()};
}

void Engine::post(Locked &locked, Thread &thread, const Assignment &assignment) {
  REDAG_CHECK(!thread.has_mail.load(std::memory_order_relaxed), "a worker was given two jobs");
  thread.mail = assignment;
  thread.has_mail.store(true, std::memory_order_release);
  if (!thread.is_handed) handed_.push_back(&thread);
  thread.is_handed = true;
  locked.wake(thread);
}

void Engine::apply(std::span<const ThreadPriorities::Change> changes) {
  for (const ThreadPriorities::Change &change : changes) {
    if (!set_fifo_priority(threads_[change.thread]->handle.native_handle(), change.priority)) {
      refused_priorities_.fetch_add(1, std::memory_order_relaxed);
    }
  }
}

// Updates the flags that let a preemption point cost one load while no job is more urgent.
void Engine::refresh_outranked() {
  for (auto &thread : threads_) {
    const bool outranked = may_start() && !thread->stack.empty() && scheduler_->outranked(thread->stack.back().slot);
    thread->outranked.store(outranked, std::memory_order_relaxed);
  }
}

}  // namespace redag::runtime
