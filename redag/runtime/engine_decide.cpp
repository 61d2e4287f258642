// How the engine carries out the scheduler's decisions. Everything here runs under the engine's lock, allocates nothing
// and looks nothing up by name.
#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/runtime/engine_parts.hpp"

namespace redag::runtime {

using sched::Dispatch;

// `self`: the calling thread, if it has just lost its job and can take another; `below`: the job suspended on it.
Engine::Next Engine::decide(Locked &locked, Time now, Thread *self, JobSlot below) {
  // Paused, only run_one() starts a job, on the caller's thread.
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
  if (has_listeners_) {
    for (const JobEvent &event : step.events) {
      const auto &listener = tasks_[event.task.value].listener;
      if (event.kind == JobEventKind::Skipped && listener) locked.tell(listener, event.reason);
    }
  }
  const Next next = os() ? place_on_pool(locked, step, self) : place_on_workers(locked, step, self, below);
  if (options_.config.preemption == sched::Preemption::Cooperative) refresh_outranked();
  return next;
}

// none, cooperative: thread w is worker w, save that the caller of run_one() does the work of whichever it was given.
Engine::Next Engine::place_on_workers(Locked &locked, const sched::Step &step, Thread *self, JobSlot below) {
  Next next;
  for (const Dispatch &dispatch : step.dispatches) {
    Thread &thread = self == caller_.get() ? *self : *threads_[dispatch.worker.value];
    if (dispatch.resume) {
      // Other than that of the job below, these are changes of level: nothing to do without levels.
      if (&thread == self && dispatch.job == below) next.kind = Next::Kind::Resume;
      continue;
    }
    const Assignment assignment = assign(thread, dispatch);
    if (&thread == self) {
      next = Next{Next::Kind::Start, assignment};
    } else {
      hand(locked, thread, assignment);
    }
  }
  return next;
}

// os: any idle thread will do; the kernel decides what really runs, by priority. Of the jobs to start the calling
// thread takes the most urgent one, so that none of those it then wakes preempts it under the lock. Nothing is done to
// a job that is preempted: whoever outranks it has a higher priority.
Engine::Next Engine::place_on_pool(Locked &locked, const sched::Step &step, Thread *self) {
  const Dispatch *own = nullptr;
  if (self != nullptr) {
    for (const Dispatch &dispatch : step.dispatches) {
      if (!dispatch.resume && (own == nullptr || dispatch.level < own->level)) own = &dispatch;
    }
  }
  const PriorityBand &band = options_.band;
  Next next;
  if (own != nullptr) {
    next = Next{Next::Kind::Start, assign(*self, *own)};
    if (self != caller_.get()) {
      apply(priorities_.start(self->index, band.of_level(own->level), next.assignment.expected_short));
    }
  } else if (self != nullptr && self != caller_.get()) {
    idle_.push_back(self);
  }
  for (const Dispatch &dispatch : step.dispatches) {
    if (&dispatch == own) continue;
    if (dispatch.resume) {
      const auto runs_it = [&](const auto &t) { return !t->stack.empty() && t->stack.back().slot == dispatch.job; };
      if (runs_it(caller_)) continue;  // at its own priority
      const auto thread = std::find_if(threads_.begin(), threads_.end(), runs_it);
      REDAG_CHECK(thread != threads_.end(), "a job goes on that no thread has");
      apply(priorities_.change((*thread)->index, band.of_level(dispatch.level)));
      continue;
    }
    REDAG_CHECK(!idle_.empty(), "more jobs started than there are threads");
    Thread &thread = *idle_.back();
    idle_.pop_back();
    const Assignment assignment = assign(thread, dispatch);
    apply(priorities_.start(thread.index, band.of_level(dispatch.level), assignment.expected_short));
    hand(locked, thread, assignment);
  }
  return next;
}

Engine::Assignment Engine::assign(Thread &thread, const Dispatch &dispatch) {
  TaskEntry &entry = tasks_[dispatch.task.value];
  REDAG_CHECK(entry.busy < entry.concurrency, "more jobs of one task at a time than it allows");
  ++entry.busy;
  ++unfinished_;
  const Job job{dispatch.task, dispatch.number, dispatch.release, dispatch.job, dispatch.worker};
  thread.stack.push_back(job);
  return Assignment{job, &entry, entry.expected_short()};
}

void Engine::hand(Locked &locked, Thread &thread, const Assignment &assignment) {
  REDAG_CHECK(!thread.has_mail.load(std::memory_order_relaxed), "a worker was given two jobs");
  thread.mail = assignment;
  thread.has_mail.store(true, std::memory_order_release);
  locked.wake(thread);
}

void Engine::apply(std::span<const ThreadPriorities::Change> changes) {
  for (const ThreadPriorities::Change &change : changes) {
    if (!set_fifo_priority(threads_[change.thread]->handle.native_handle(), change.priority)) {
      refused_priorities_.fetch_add(1, std::memory_order_relaxed);
    }
  }
}

// Lets preemption points cost one load while there is nothing to do.
void Engine::refresh_outranked() {
  for (auto &thread : threads_) {
    const bool outranked = may_start() && !thread->stack.empty() && scheduler_->outranked(thread->stack.back().slot);
    thread->outranked.store(outranked, std::memory_order_relaxed);
  }
}

}  // namespace redag::runtime
