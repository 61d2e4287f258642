// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/engine.hpp"

#include <algorithm>
#include <array>
#include <climits>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/engine_parts.hpp"
#include "redag/runtime/preemption_point.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::runtime {

using sched::Outcome;

namespace {

// Any thread can run most of the jobs, but not all threads can do so at once. Large pools share the room of 64 threads.
std::size_t events_of_thread(std::size_t trace_capacity, std::uint32_t threads) {
  constexpr std::size_t kWhole = 64;
  constexpr std::size_t kLeast = 4096;
  if (threads <= kWhole) return trace_capacity;
  return std::max(std::min(trace_capacity, kLeast), trace_capacity * kWhole / threads);
}

}  // namespace

Engine::Engine(std::unique_ptr<sched::Scheduler> scheduler, EngineOptions options)
    : options_(std::move(options)),
      lock_(realtime()),
      scheduler_(std::move(scheduler)),
      priorities_(os() ? options_.config.max_started : 0, options_.band.top_job),
      paused_(options_.start_paused),
      decisions_(options_.trace_capacity) {
  const sched::Config &config = options_.config;
  REDAG_CHECK(!os() || config.max_started >= config.workers, "os: a thread for every processor, at least");
  REDAG_CHECK(!os() || options_.spins == 0, "os: a thread that looks for a job would keep others off its processor");
  const std::uint32_t count = os() ? config.max_started : config.workers;
  idle_.reserve(count);
  handed_.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    threads_.push_back(std::make_unique<Thread>(i, events_of_thread(options_.trace_capacity, count)));
  }
  caller_ = std::make_unique<Thread>(count, options_.trace_capacity);
  caller_->stack.reserve(1);
  if (os() && options_.throttling) {
    share_.emplace(*options_.throttling);
    share_keeper_ = std::make_unique<ShareKeeper>();
  }
}

Engine::~Engine() {
  halt();
  join();
}

Time Engine::now() const noexcept {
  const Time origin = origin_.load(std::memory_order_relaxed);
  return origin == kNever ? 0 : monotonic_now() - origin;
}

// ---- threads ----

Result<void> Engine::start() {
  std::vector<int> cpus = options_.cpus;
  const std::vector<int> usable = usable_cpus();
  if (os() && cpus.empty()) {
    // The kernel runs the m most urgent threads only if it has exactly m processors to choose from. The last ones are
    // taken, because the first ones serve most interrupts.
    const std::size_t workers = options_.config.workers;
    if (workers <= usable.size()) cpus.assign(usable.end() - static_cast<std::ptrdiff_t>(workers), usable.end());
  }
  if (Result<void> started = start_threads(cpus); !started) {
    end_threads();
    return started;
  }
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  if (cpus.empty()) cpus = usable;
  priorities_.set_processors(std::min(cpus.size(), usable.size()));
  if (share_) {
    share_.emplace(*options_.throttling, cpus.size());
    realtime_on_.resize(cpus.size());
    for (std::size_t i = 0; i < cpus.size(); ++i) {
      const auto cpu = static_cast<std::size_t>(cpus[i]);
      if (cpu >= share_places_.size()) share_places_.resize(cpu + 1, kNowhere);
      share_places_[cpu] = i;
    }
  }
  for (auto thread = threads_.rbegin(); thread != threads_.rend(); ++thread) idle_.push_back(thread->get());
  running_ = true;
  decide(locked, at, nullptr, JobSlot());
  return {};
}

Result<void> Engine::start_threads(const std::vector<int> &cpus) {
  for (auto &thread : threads_) {
    const ThreadSetup setup{options_.name + "-" + std::to_string(thread->index), realtime() ? options_.band.top_job : 0,
                            cpus, options_.touched_stack, &thread->processor};
    Result<ThreadHandle> started = start_thread(setup, [this, &self = *thread] { main(self); });
    if (!started) return tl::unexpected(started.error());
    thread->handle = *std::move(started);
    thread->cpu_clock = cpu_clock_of(thread->handle);
  }
  if (!share_keeper_) return {};
  Result<ThreadHandle> started =
      start_thread({options_.name + "-guard", options_.band.timer, {}}, [this] { guard_throttling(); });
  if (!started) return tl::unexpected(started.error());
  share_keeper_->handle = *std::move(started);
  return {};
}

// No thread has a job: none starts before running_ is set.
void Engine::end_threads() {
  exit_.store(true, std::memory_order_release);
  for (auto &thread : threads_) {
    thread->parker.unpark();
    if (thread->handle.joinable()) thread->handle.join();
    thread->processor = nullptr;
  }
  exit_.store(false, std::memory_order_release);
}

void Engine::main(Thread &self) noexcept {
  for (;;) {
    // Read before the mail: all mail was posted before this was set.
    const bool exiting = exit_.load(std::memory_order_acquire);
    if (self.take_mail()) {
      const Assignment first = self.mail;
      // A job that was dispatched to this very thread when the last one ended needs no wake-up.
      Next next{Next::Kind::Start, first};
      self.meter.pass();
      Time at = now();
      while (next.kind == Next::Kind::Start) next = run(self, next.assignment, JobSlot(), at);
      continue;
    }
    if (exiting) return;
    self.parker.park(options_.spins);
  }
}

void Engine::join() {
  halt();
  {
    // A decision that was under way has posted its jobs. No later one starts a job.
    Locked locked(*this);
    withdraw_if_halting();
    for (auto &thread : threads_) thread->processor = nullptr;  // it ends with the thread
  }
  exit_.store(true, std::memory_order_release);
  for (auto &thread : threads_) thread->parker.unpark();
  for (auto &thread : threads_) {
    if (thread->handle.joinable()) thread->handle.join();
  }
  if (!share_keeper_) return;
  share_keeper_->parker.unpark();
  if (share_keeper_->handle.joinable()) share_keeper_->handle.join();
}

// The throttling guard: sleeps until a job is in progress, then checks several times a second while there are jobs.
void Engine::guard_throttling() noexcept {
  for (Duration until_next = kNever;;) {
    if (until_next == kNever) {
      share_keeper_->parker.park();
    } else {
      share_keeper_->parker.park_until(monotonic_now() + until_next);
    }
    if (exit_.load(std::memory_order_acquire)) return;
    until_next = look_at_share();
  }
}

std::optional<TaskId> Engine::current_task() const noexcept {
  for (const RunningJob *job = RunningJob::current(); job != nullptr; job = job->below) {
    if (job->engine == this) return job->task;
  }
  return std::nullopt;
}

// ---- jobs, on their threads ----

// Runs a job to its end, on top of `below` if that is valid. `at` is when it begins, and is set to when it ends. A job
// that follows another on its thread is charged for the decision between the two, which saves reading clocks. Returns
// the thread's next action.
Engine::Next Engine::run(Thread &self, const Assignment &assignment, JobSlot below, Time &at) noexcept {
  const Job &job = assignment.job;
  if (options_.trace_capacity > 0) {
    const Time begun = now();
    self.events.push(
        JobEvent{begun, begun, job.task, job.number, job.worker.value, JobEventKind::Started, Reason::None, 0});
  }
  RunningJob running;
  running.engine = this;
  running.thread = self.index;
  running.outranked = &self.outranked;
  running.task = job.task;
  running.slot = job.slot;
  running.top = &self.top;
  running.limit = assignment.entry->next_limit(running);
  running.begun = at;
  running.start = self.meter.begin(at, !assignment.expected_short);
  running.below = RunningJob::current();
  RunningJob::set_current(&running);
  running.enter();
  const Outcome outcome = call(assignment);
  running.leave();
  RunningJob::set_current(running.below);
  at = now();
  const Duration used = charge(self, *assignment.entry, running, at);
  if (options_.trace_capacity > 0) {
    self.events.push(
        JobEvent{at, used, job.task, job.number, job.worker.value, JobEventKind::Executed, Reason::None, 0});
  }
  return finish(self, assignment, running, outcome, at, used, below);
}

// Returns the processor time that a job used which ended at `at`.
Duration Engine::charge(Thread &self, const TaskEntry &entry, const RunningJob &running, Time at) noexcept {
  const Duration took = at - running.begun;
  if (running.total < 0 && took <= CpuMeter::kShort && !entry.always_measured()) {
    self.meter.pass();
    return took;
  }
  const Duration used = running.total >= 0 ? running.total : running.cpu_time();
  if (running.start.exact) {
    self.meter.set(running.start.cpu + used, at);
  } else {
    self.meter.pass();
  }
  return used;
}

Outcome Engine::call(const Assignment &assignment) {
  try {
    return assignment.entry->body(assignment.job);
  } catch (const BudgetExceeded &) {
    return Outcome::BudgetExceeded;
  } catch (...) {
    if (options_.on_exception) options_.on_exception(assignment.job, std::current_exception());
    return Outcome::Threw;
  }
}

Engine::Next Engine::finish(Thread &self, const Assignment &assignment, RunningJob &running, Outcome outcome, Time at,
                            Duration used, JobSlot below) {
  Body doomed;  // of a removed task; destroyed without the lock
  TaskEntry &entry = *assignment.entry;
  const bool measured = entry.response && outcome == Outcome::Finished;
  const Duration response = at - assignment.job.release;
  if (measured) entry.response->add(response);
  Locked locked(*this);
  withdraw_if_halting();
  entry.count(used, at - running.begun);
  if (measured && response > entry.deadline) ++entry.late;
  --entry.busy;
  if (entry.removed && entry.busy == 0) doomed.swap(entry.body);
  self.stack.pop_back();
  if (os() && &self != caller_.get()) priorities_.end(self.index);
  --unfinished_;
  if (used > running.limit) {
    running.used_budget = running.used_budget || outcome == Outcome::BudgetExceeded;
    report_limits(running, used, at);
  }
  scheduler_->complete(assignment.job.slot, at, outcome);
  const Next next = decide(locked, at, &self == caller_.get() ? nullptr : &self, below);
  if (unfinished_ == 0 && halted_at_ != kNever) idle_event_.set();
  if (unfinished_ == 0 && pause_waiters_ > 0) wake_pause_waiters();
  return next;
}

Duration RunningJob::cpu_time() const noexcept {
  const Duration used = thread_cpu_now() - start.cpu;
  return start.exact ? used : std::min(used, engine->now() - begun);
}

void RunningJob::reach_preemption_point() { engine->preemption_point(*this); }

void RunningJob::reach_limit(Duration used) { engine->reach_limit(*this, used); }

// At a preemption point: reports the limits that the job has used to the scheduler, or cuts the job off.
void Engine::reach_limit(RunningJob &job, Duration used) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  const TaskEntry &entry = tasks_[job.task.value];
  const bool cut_off = entry.cuts_off && entry.budget > 0 && used > entry.budget;
  job.used_budget = job.used_budget || cut_off;
  report_limits(job, used, at);
  decide(locked, at, nullptr, JobSlot());
  if (cut_off) throw BudgetExceeded{};
}

void Engine::report_limits(RunningJob &job, Duration used, Time now) {
  tell_limits(job, used, now, false);
  job.limit = tasks_[job.task.value].next_limit(job);
}

// From outside, leaves a job that is to be cut off alone until its own preemption point or its end.
bool Engine::tell_limits(RunningJob &job, Duration used, Time now, bool from_outside) {
  const TaskEntry &entry = tasks_[job.task.value];
  bool told = false;
  if (entry.wcet_low > 0 && used > entry.wcet_low && !job.used_wcet_low) {
    job.used_wcet_low = told = true;
    scheduler_->exceed(job.slot, sched::Limit::WcetLow, now);
  }
  if (entry.budget > 0 && used > entry.budget && !job.used_budget && !(from_outside && entry.cuts_off)) {
    job.used_budget = told = true;
    scheduler_->exceed(job.slot, sched::Limit::Budget, now);
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
  withdraw_if_halting();
  bool told = false;
  for (auto &thread : threads_) {
    RunningJob *running = thread->stack.empty() ? nullptr : thread->top.load(std::memory_order_acquire);
    if (running == nullptr || running->slot != thread->stack.back().slot) continue;
    const Job &job = thread->stack.back();
    TaskEntry &entry = tasks_[job.task.value];
    const Duration elapsed = as_of - running->begun;
    const bool overdue = !running->reported && entry.is_overdue(elapsed, limits);
    // A job cannot have used more than the time that has passed.
    const Duration limit = entry.next_limit(*running);
    if (!overdue && (limit == kNever || elapsed <= limit)) continue;
    // For a task with limits the start is exact. For others, `used` only serves the report.
    const Duration used = cpu_now(thread->cpu_clock) - running->start.cpu;
    if (thread->top.load(std::memory_order_acquire) != running) continue;  // it has ended and waits for the lock
    if (used - kSlack > limit) told = tell_limits(*running, used - kSlack, at, true) || told;
    if (!overdue) continue;
    running->reported = true;
    ++entry.usage.overdue;
    out.push_back(OverdueJob{job, elapsed, used});
  }
  if (told) decide(locked, at, nullptr, JobSlot());
}

void Engine::preemption_point(RunningJob &job) {
  Thread &self = *threads_[job.thread];
  Next next;
  Time at = now();
  {
    Locked locked(*this);
    withdraw_if_halting();
    if (!scheduler_->outranked(job.slot)) return;
    scheduler_->preemption_point(job.slot, at);
    next = decide(locked, at, &self, job.slot);
  }
  if (next.kind != Next::Kind::Start) return;
  const Duration used = job.cpu_time();
  self.meter.pass();
  while (next.kind == Next::Kind::Start) next = run(self, next.assignment, job.slot, at);
  REDAG_CHECK(next.kind == Next::Kind::Resume, "a suspended job was not resumed");
  job.start = CpuMeter::Start{thread_cpu_now() - used, true};
  job.enter();
}

// ---- events from outside ----

void Engine::release(std::span<const Release> releases) {
  const Time at = now();
  Locked locked(*this, releases.size());
  withdraw_if_halting();
  if (halted_at_ != kNever) return;
  do {
    const auto lot = releases.first(std::min(releases.size(), sched::kMostReleasesAtOnce));
    for (const Release &release : lot) scheduler_->release(release.task, release.nominal, at);
    decide(locked, at, nullptr, JobSlot());
    releases = releases.subspan(lot.size());
  } while (!releases.empty());
}

void Engine::release(TaskId task, Time nominal) {
  const Release one{task, nominal};
  release(std::span(&one, 1));
}

void Engine::miss(TaskId task, Time nominal, Reason reason) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  if (halted_at_ != kNever) return;
  scheduler_->miss(task, nominal, at, reason);
  decide(locked, at, nullptr, JobSlot());
  locked.tell_nobody();
}

// ---- pauses ----

void Engine::pause() {
  Locked locked(*this);
  paused_ = true;
  refresh_outranked();
}

void Engine::resume() {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  paused_ = false;
  if (pause_waiters_ > 0) wake_pause_waiters();
  decide(locked, at, nullptr, JobSlot());
}

bool Engine::wait_paused(Time deadline) {
  for (bool in_time = true;;) {
    std::uint32_t seen = 0;
    {
      Locked locked(*this);
      if (!paused_) return false;
      if (unfinished_ == 0) return true;
      if (!in_time) return false;
      ++pause_waiters_;
      seen = pause_changes_.load(std::memory_order_relaxed);
    }
    in_time = futex_wait_until(pause_changes_, seen, deadline);
    Locked locked(*this);
    --pause_waiters_;
  }
}

void Engine::wake_pause_waiters() {
  pause_changes_.fetch_add(1, std::memory_order_release);
  futex_wake(pause_changes_, INT_MAX);
}

bool Engine::run_one() {
  Next next;
  {
    const Time at = now();
    Locked locked(*this);
    withdraw_if_halting();
    REDAG_CHECK(paused_, "run_one() is for a paused engine");
    REDAG_CHECK(caller_->stack.empty(), "one run_one() at a time");
    next = decide(locked, at, caller_.get(), JobSlot());
  }
  if (next.kind != Next::Kind::Start) return false;
  caller_->meter.forget();
  Time at = now();
  run(*caller_, next.assignment, JobSlot(), at);
  return true;
}

// ---- the end ----

// The first thread to take the lock after halt() skips the jobs that have not started. These skips are the engine's,
// not the model's: they are not recorded, and the jobs count as in flight.
void Engine::withdraw_if_halting() {
  if (halted_at_ != kNever || !halting_.load(std::memory_order_acquire)) return;
  halted_at_ = now();
  scheduler_->close(halted_at_);
  const sched::Step step = scheduler_->dispatch(halted_at_);
  for (const JobEvent &event : step.events) {
    if (event.kind == JobEventKind::Skipped) ++tasks_[event.task.value].withdrawn;
  }
  REDAG_CHECK(step.dispatches.empty(), "a job was started after the end");
}

bool Engine::wait_idle(Time deadline) {
  {
    Locked locked(*this);
    withdraw_if_halting();
    REDAG_CHECK(halted_at_ != kNever, "wait_idle() is for after halt()");
    if (unfinished_ == 0) return true;
  }
  return idle_event_.wait_until(deadline);
}

// ---- what can be asked ----

Duration Engine::gave_way() const {
  const Time at = now();
  const LockGuard guard(lock_);
  return gave_way_ + (giving_way_ ? std::max<Duration>(0, at - giving_way_since_) : 0);
}

std::uint64_t Engine::thread_waits() const {
  const LockGuard guard(lock_);
  return scheduler_->thread_waits();
}

Time Engine::halted_at() const {
  const LockGuard guard(lock_);
  return halted_at_;
}

std::vector<Job> Engine::started() const {
  const LockGuard guard(lock_);
  std::vector<Job> jobs;
  for (const auto &thread : threads_) jobs.insert(jobs.end(), thread->stack.begin(), thread->stack.end());
  jobs.insert(jobs.end(), caller_->stack.begin(), caller_->stack.end());
  return jobs;
}

void Engine::drain(std::vector<JobEvent> &out, bool last) {
  decisions_.drain(merge_.decisions());
  for (auto &thread : threads_) thread->events.drain(merge_.started());
  caller_->events.drain(merge_.started());
  merge_.merge(out, last);
}

std::uint64_t Engine::lost_events() const {
  if (options_.trace_capacity == 0) return 0;
  std::uint64_t lost = decisions_.dropped();
  for (const auto &thread : threads_) lost += thread->events.dropped();
  lost += caller_->events.dropped();
  return lost;
}

}  // namespace redag::runtime
