// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Jobs on their threads: each is run, measured, limited, and ended here.
#include <algorithm>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/engine.hpp"
#include "redag/engine/engine_locked.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/threads/clock.hpp"
#include "redag/trace/tap.hpp"

// Members that are declared inline here are for run() alone.

namespace redag::runtime {

using sched::Outcome;

namespace {

/// The job goes on after a wait.
void restore(RunningJob &running, WaitingJob &job) {
  running.waiting = &job;
  running.used_wcet_low = job.used_wcet_low;
  running.used_budget = job.used_budget;
  running.limit = job.entry->next_limit(running);
  running.measured = job.measured;
  running.reported = job.reported;
  running.begun = job.begun;
  running.before = job.charged;
  running.earlier = job.earlier;
}

}  // namespace

const RunningJob *Engine::current_job() const noexcept {
  const RunningJob *job = RunningJob::current();
  while (job != nullptr && job->engine != this) job = job->below;
  return job;
}

// Runs the taker's next job, and those that it is given at the end of each. They need no wake-up. `at` is when the
// first one begins. Not for a thread without a next job.
void Engine::run(Taker &taker, Time at) noexcept {
  WorkerThread &self = taker.thread;
  RunningJob running(this, self, taker.next.assignment.job);
  do {
    if (self.led && running.below == nullptr && !taker.next.assignment.expected_short) follow(self);
    at = run_next(taker, running, at);
  } while (taker.next.kind == Next::Kind::Start);
}

// Runs the taker's next job to its end, and decides what it does then. Returns when the thread's next job begins. A job
// that follows another on its thread is charged for the decision between the two, which saves reading clocks. On the
// clock, it does not take the time for which that decision was delayed, nor the time to ask for the thread's processor
// time.
[[gnu::always_inline]] inline Time Engine::run_next(Taker &taker, RunningJob &running, Time at) noexcept {
  WorkerThread &self = taker.thread;
  const Assignment &assignment = taker.next.assignment;
  const Job &job = assignment.job;
  const trace::Tap *const tap = trace::tap();
  const bool is_traced = options_.trace_capacity > 0;
  const bool is_told = is_traced || tap != nullptr;
  const auto tell = [&](JobEventKind kind, Time time, std::int64_t value) {
    const JobEvent event{time, value, job.task, job.number, job.worker.value, kind, Reason::None, 0};
    if (is_traced) self.events.push(event);
    if (tap != nullptr) tap->event(this, event);
  };
  if (is_told && assignment.woken == nullptr) {
    const Time begun = now();
    tell(JobEventKind::Started, begun, begun);
  }
  running.limit = assignment.entry->first_limit;
  running.measured = assignment.entry->always_measured;
  running.used_wcet_low = running.used_budget = running.reported = running.cancelled = false;
  running.blocks = running.begins_coroutine = running.has_released = false;
  running.before = running.earlier = 0;
  running.waiting = nullptr;
  running.wait = nullptr;
  if (self.meter.needs_reading(at, !assignment.expected_short)) {
    self.meter.set(thread_cpu_now(), at);
    at = now();
  }
  running.begun = running.here_since = at;
  running.start = self.meter.start();
  if (assignment.woken != nullptr) restore(running, *assignment.woken);
  RunningJob::set_current(&running);
  running.enter();
  Outcome outcome = call(assignment, running);
  running.end();
  RunningJob::set_current(running.below);
  if (running.on_trust || !running.start.exact) {
    self.meter.pass();
  } else {
    self.meter.set(running.start.cpu + running.charged - running.before, running.ended);
  }
  if (running.wait != nullptr) {
    if (const std::optional<Time> next = suspend(taker, running)) return *next;
    outcome = Outcome::BudgetExceeded;
  }
  if (running.waiting != nullptr) delete std::exchange(running.waiting, nullptr);  // the body has blocked
  if (is_told) tell(JobEventKind::Executed, running.ended, running.charged);
  return finish(taker, running, outcome);
}

inline Outcome Engine::call(const Assignment &assignment, RunningJob &running) {
  begin_unbounded_work();
  try {
    return assignment.woken == nullptr ? assignment.entry->body(assignment.job) : go_on(running);
  } catch (const BudgetExceeded &) {
    return Outcome::BudgetExceeded;
  } catch (const WaitCancelled &) {
    running.cancelled = true;
    return Outcome::Threw;
  } catch (...) {
    if (options_.on_exception) options_.on_exception(assignment.job, std::current_exception());
    return Outcome::Threw;
  }
}

// Returns when the thread's next job begins.
[[gnu::always_inline]] inline Time Engine::finish(Taker &taker, RunningJob &running, Outcome outcome) {
  WorkerThread &self = taker.thread;
  TaskEntry &entry = *taker.next.assignment.entry;
  const Time at = running.ended;
  const Job &job = running.job;  // until the decision replaces it
  if (entry.response && outcome == Outcome::Finished) {
    entry.response->add(at - job.release);
    entry.execution->add(running.charged);
    if (entry.end_to_end && entry.end_to_end != entry.response) entry.end_to_end->add(at - job.origin);
  }
  Locked locked(*this);
  withdraw_if_halting(locked);
  entry.count(running.charged, running.earlier + at - running.here_since);
  if (running.has_released) entry.count_tail(at - running.released);
  self.used += running.charged - running.before;
  --entry.busy;
  if (entry.is_special || outcome != Outcome::Finished) {
    finish_special(locked, running, entry, outcome);
  } else if (at - job.release > entry.deadline) {
    count_late(job, entry, at);
  }
  const sched::Step step = scheduler_->finish(job.slot, at, outcome, most_to_start());
  if (may_hand_over() && placement_.hand_over(taker, step, tasks_, locked.waited())) {
    if (!step.events.empty()) report(locked, step.events);
  } else {
    const bool is_caller = &self == &pool_.caller();
    taker.next.kind = Next::Kind::Nothing;
    placement_.end(self);
    carry_out(locked, step, at, is_caller ? nullptr : &taker);
    if (placement_.unfinished() == 0) end_of_jobs();
  }
  return locked.release() || !running.on_trust ? now() : at;
}

[[gnu::noinline]] void Engine::finish_special(Locked &locked, RunningJob &running, TaskEntry &entry, Outcome outcome) {
  const Time at = running.ended;
  const Job &job = running.job;
  if (outcome == Outcome::Finished) {
    if (at - job.release > entry.deadline) count_late(job, entry, at);
    if (at - job.origin > entry.dag_deadline) ++entry.late_end_to_end;
  } else if (running.cancelled) {
    ++entry.cancelled;
  }
  if (options_.misses != nullptr && !running.cancelled) note_misses(locked, job, entry, at, outcome);
  if (entry.removed && entry.busy == 0) locked.destroy(entry.body);
  if (running.charged > running.limit) {
    running.used_budget = running.used_budget || outcome == Outcome::BudgetExceeded;
    report_limits(running, running.charged, at);
  }
}

[[gnu::noinline]] void Engine::count_late(const Job &job, TaskEntry &entry, Time at) {
  ++entry.late;
  const trace::Tap *const tap = trace::tap();
  if (tap == nullptr || entry.deadline <= 0) return;
  tap->late(this, {at, at, job.task, job.number, job.worker.value, JobEventKind::Finished, Reason::None, 0},
            at - job.release - entry.deadline);
}

void Engine::note_misses(Locked &locked, const Job &job, const TaskEntry &entry, Time at, Outcome outcome) {
  const auto note = [&](MissKind kind, Reason reason, Duration lateness) {
    if (options_.misses->note({at, lateness, job.task, job.number, kind, reason})) {
      locked.wake_ups().wake_late(options_.misses->parker());
    }
  };
  if (outcome == Outcome::NoData) return;
  if (outcome != Outcome::Finished) return note(MissKind::Aborted, sched::reason_of(outcome), 0);
  if (const Duration lateness = at - job.release - entry.deadline; lateness > 0) {
    note(MissKind::Late, Reason::None, lateness);
  }
  if (entry.dag_deadline == kNever) return;
  if (const Duration lateness = at - job.origin - entry.dag_deadline; lateness > 0) {
    note(MissKind::EndToEnd, Reason::None, lateness);
  }
}

// end_of_jobs() is called when no started job is left.
void Engine::end_of_jobs() {
  if (halted_at_ != kNever) idle_event_.set();
  if (pause_waiters_ > 0) wake_pause_waiters();
}

RunningJob::RunningJob(Engine *its_engine, WorkerThread &its_thread, const Job &its_job) noexcept
    : engine(its_engine),
      thread(its_thread.index),
      outranked(&its_thread.outranked),
      below(current()),
      top(&its_thread.top),
      job(its_job) {}

inline void RunningJob::end() noexcept {
  leave();
  ended = engine->now();
  const Duration took = ended - here_since;
  on_trust = took <= CpuMeter::kShort && !measured;
  charged = before + (on_trust ? took : stretch_cpu_time());
}

Duration RunningJob::stretch_cpu_time() const noexcept {
  const Duration used = thread_cpu_now() - start.cpu;
  return start.exact ? used : std::min(used, engine->now() - here_since);
}

void RunningJob::charge(Duration stretch) noexcept {
  before += stretch;
  start = CpuMeter::Start{thread_cpu_now(), true};
}

void RunningJob::reach_preemption_point() { engine->preemption_point(*this); }

void RunningJob::reach_limit(Duration used) { engine->reach_limit(*this, used); }

bool RunningJob::lend_worker() { return engine->lend_worker(*this); }

void RunningJob::take_worker() noexcept { engine->take_worker(*this); }

// At a preemption point: reports the limits that the job has used to the scheduler, or cuts the job off.
void Engine::reach_limit(RunningJob &job, Duration used) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  const TaskEntry &entry = tasks_[job.job.task];
  const bool cut_off = entry.cuts_off && entry.budget > 0 && used > entry.budget;
  job.used_budget = job.used_budget || cut_off;
  report_limits(job, used, at);
  decide(locked, at);
  if (cut_off) throw BudgetExceeded{};
}

void Engine::report_limits(RunningJob &job, Duration used, Time now) {
  tell_limits(job, used, now, false);
  job.limit = tasks_[job.job.task].next_limit(job);
}

// From outside, leaves a job that is to be cut off alone until its own preemption point or its end.
bool Engine::tell_limits(RunningJob &job, Duration used, Time now, bool from_outside) {
  const TaskEntry &entry = tasks_[job.job.task];
  bool told = false;
  if (entry.wcet_low > 0 && used > entry.wcet_low && !job.used_wcet_low) {
    job.used_wcet_low = told = true;
    scheduler_->exceed(job.job.slot, sched::Limit::WcetLow, now);
  }
  if (entry.budget > 0 && used > entry.budget && !job.used_budget && !(from_outside && entry.cuts_off)) {
    job.used_budget = told = true;
    scheduler_->exceed(job.job.slot, sched::Limit::Budget, now);
  }
  return told;
}

// `RunningJob::limit` belongs to the job's thread, which reads it without the lock. watch() does not change it. The
// next preemption point then finds nothing more to report.
void Engine::watch(const WatchLimits &limits, Time as_of, std::vector<OverdueJob> &out) {
  // A job that has just ended can seem to have used up to this much more than it did.
  constexpr Duration kSlack = 10 * kMicrosecond;
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  bool told = false;
  for (const auto &thread : pool_.threads()) {
    RunningJob *running = thread->stack.empty() ? nullptr : thread->top.load(std::memory_order_acquire);
    if (running == nullptr || running->job.slot != thread->stack.back().slot) continue;
    const Job &job = thread->stack.back();
    TaskEntry &entry = tasks_[job.task];
    const Duration elapsed = as_of - running->begun;
    const bool overdue = !running->reported && entry.is_overdue(elapsed, limits);
    // A job cannot have used more than the time that has passed.
    const Duration limit = entry.next_limit(*running);
    if (!overdue && (limit == kNever || elapsed <= limit)) continue;
    // For a task with limits the start is exact. For others, `used` only serves the report.
    const Duration used = running->before + cpu_now(thread->cpu_clock) - running->start.cpu;
    if (thread->top.load(std::memory_order_acquire) != running) continue;  // it has ended and waits for the lock
    if (used - kSlack > limit) told = tell_limits(*running, used - kSlack, at, true) || told;
    if (!overdue) continue;
    running->reported = true;
    ++entry.usage.overdue;
    out.push_back(OverdueJob{job, elapsed, used});
  }
  waiting_.for_each([&](WaitingJob &waiting) {
    if (waiting.reported || !waiting.entry->is_overdue(as_of - waiting.begun, limits)) return;
    waiting.reported = true;
    ++waiting.entry->usage.overdue;
    out.push_back(OverdueJob{waiting.job, as_of - waiting.begun, waiting.charged});
  });
  if (told) decide(locked, at);
}

void Engine::preemption_point(RunningJob &job) {
  Taker taker{.thread = pool_[job.thread], .below = job.job.slot, .takes_any = false};
  const Time at = now();
  {
    Locked locked(*this);
    withdraw_if_halting(locked);
    if (!scheduler_->outranked(job.job.slot)) return;
    scheduler_->preemption_point(job.job.slot, at);
    decide(locked, at, &taker);
  }
  if (taker.next.kind == Next::Kind::Start) {
    const Duration used = job.stretch_cpu_time();
    taker.thread.meter.pass();
    run(taker, at);
    REDAG_CHECK(taker.next.kind != Next::Kind::Nothing, "a suspended job was not resumed");
    job.start = CpuMeter::Start{thread_cpu_now() - used, true};
    job.enter();
  }
  if (taker.next.kind == Next::Kind::Yield) taker.thread.wait_for_worker();
}

}  // namespace redag::runtime
