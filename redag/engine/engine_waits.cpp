// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Jobs that wait without a thread: how they leave their threads, and who wakes them.
#include <memory>
#include <optional>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/engine/engine.hpp"
#include "redag/engine/engine_locked.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {

Result<void> Engine::let_wait() {
  if (lets_wait_) return {};
  if (!sleepers_) sleepers_ = std::make_unique<ReleaseThread>([this] { return wake_sleepers(); });
  if (!wakes_) wakes_ = std::make_shared<InProgress>();
  Result<void> started = sleepers_->start({options_.name + "-waits", options_.waits_priority, usable_});
  if (!started) return started;
  started = devices_.start({options_.name, options_.waits_priority, usable_},
                           [this](DeviceThread &thread, JobSlot job) { end_service(thread, job); });
  if (!started) {
    devices_.end();
    return started;
  }
  lets_wait_ = true;
  return {};
}

// No job is left.
void Engine::end_waits() {
  sleepers_->stop();
  sleepers_->join();
  devices_.end();
  wakes_->wait();
}

// The body has returned at a co_await. Returns when the thread's next job begins, or nothing if the job ends instead,
// cut off at its budget. Once the lock is released, another thread may run the job, and end it.
std::optional<Time> Engine::suspend(Taker &taker, RunningJob &running) {
  REDAG_CHECK(lets_wait_, "a job waits in an engine without let_wait()");
  WorkerThread &self = taker.thread;
  WaitingJob &job = *running.waiting;
  TaskEntry &entry = *taker.next.assignment.entry;
  const Time at = running.ended;
  if (entry.cuts_off && entry.budget > 0 && running.charged > entry.budget) {
    delete std::exchange(running.waiting, nullptr);  // the destructors of the body's locals run here
    return std::nullopt;
  }
  Locked locked(*this);
  withdraw_if_halting(locked);
  self.used += running.charged - running.before;
  if (running.charged > running.limit) report_limits(running, running.charged, at);
  job.wait = running.wait;
  job.job = running.job;
  job.entry = &entry;
  job.begun = running.begun;
  job.charged = running.charged;
  job.earlier = running.earlier + at - running.here_since;
  job.level = self.level;
  job.measured = running.measured;
  job.used_wcet_low = running.used_wcet_low;
  job.used_budget = running.used_budget;
  job.reported = running.reported;
  waiting_.add(job, at);
  placement_.leave(self);
  scheduler_->wait(job.job.slot, job.wait->device, at);
  const Time alarm = waiting_.next_alarm();
  if (!waiting_.begin(*job.wait)) {
    waiting_.end(job.job.slot, at);
    scheduler_->wake(job.job.slot, at);
  } else if (waiting_.next_alarm() < alarm) {
    sleepers_->changed();
  }
  taker.next.kind = Next::Kind::Nothing;
  decide(locked, at, &taker);
  return locked.release() || !running.on_trust ? now() : at;
}

// The body is about to block: as suspend(), but the job keeps its thread.
bool Engine::lend_worker(RunningJob &running) {
  if (running.blocks || running.thread == pool_.caller().index) return false;
  WorkerThread &self = pool_[running.thread];
  if (running.waiting == nullptr) running.waiting = new WaitingJob();
  WaitingJob &job = *running.waiting;
  const Duration used = running.stretch_cpu_time();
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  job.job = self.stack.back();
  job.entry = &tasks_[running.job.task];
  if (running.below != nullptr || !placement_.lend(self)) {
    ++job.entry->kept_worker;
    return false;
  }
  running.leave();
  running.charge(used);
  self.used += used;
  running.earlier += at - running.here_since;
  running.limit = kNever;  // preemption points do nothing meanwhile
  running.blocks = true;
  job.thread = &self;
  job.wait = nullptr;
  job.begun = running.begun;
  job.charged = running.before;
  job.reported = running.reported;
  waiting_.add(job, at);
  scheduler_->wait(job.job.slot, DeviceId(), at);
  decide(locked, at);
  return true;
}

// The call that blocked has returned. Waits for a worker.
void Engine::take_worker(RunningJob &running) {
  WorkerThread &self = pool_[running.thread];
  const Duration used = running.stretch_cpu_time();  // in the scope, without a worker
  running.charge(used);
  const Time at = now();
  {
    Locked locked(*this);
    withdraw_if_halting(locked);
    self.used += used;
    wake(running.job.slot, at);
    decide(locked, at);
  }
  self.wait_for_worker();
  running.reported = running.waiting->reported;
  running.limit = running.waiting->entry->next_limit(running);
  running.here_since = now();
  running.blocks = false;
  running.enter();
}

void Engine::wake(JobSlot job, Time at) {
  waiting_.end(job, at);
  scheduler_->wake(job, at);
}

void Engine::wake_all(detail::Wait *waits) {
  while (waits != nullptr) waits = waits->engine->wake_own(waits);
}

// Wakes the jobs of this engine, and returns the waits of others. After the decision the jobs may end, and with them
// their waits and this engine: join() then waits for `wakes_`.
detail::Wait *Engine::wake_own(detail::Wait *waits) {
  detail::Wait *others = nullptr;
  const Time at = now();
  std::shared_ptr<InProgress> wakes;
  {
    Locked locked(*this);
    withdraw_if_halting(locked);
    wakes = wakes_;
    wakes->begin();
    while (waits != nullptr) {
      detail::Wait *const next = waits->next;
      if (waits->engine == this) {
        wake(waits->job, at);
      } else {
        waits->next = std::exchange(others, waits);
      }
      waits = next;
    }
    decide(locked, at);
  }
  static_cast<void>(wakes->end());
  return others;
}

Time Engine::wake_sleepers() {
  const Time due = monotonic_now();
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  bool woken = false;
  while (waiting_.next_alarm() <= due) {
    const JobSlot job = waiting_.take_sleeper();
    if (!job.valid()) continue;
    wake(job, at);
    woken = true;
  }
  if (woken) decide(locked, at);
  return waiting_.next_alarm();
}

void Engine::end_service(DeviceThread &thread, JobSlot job) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  waiting_.end_service(thread, at);
  wake(job, at);
  decide(locked, at);
}

void Engine::end_started() {
  {
    const Time at = now();
    Locked locked(*this);
    withdraw_if_halting(locked);
    REDAG_CHECK(paused_, "end_started() is for a paused engine");
    waiting_.cancel_all();
    if (waiting_.has_cancelled()) wake_cancelled(locked, at);
  }
  static_cast<void>(wait_paused(kNever));
  Locked locked(*this);
  if (halted_at_ == kNever) waiting_.accept();
}

// After the stop a device serves nobody: each job that it would serve next is woken instead.
void Engine::wake_cancelled(Locked &locked, Time at) {
  while (waiting_.has_cancelled()) wake(waiting_.take_cancelled(), at);
  decide(locked, at);
}

}  // namespace redag::runtime
