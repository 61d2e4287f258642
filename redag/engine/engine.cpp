// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/engine.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <climits>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/engine/engine_locked.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/tap.hpp"

namespace redag::runtime {

namespace {

// How long the release thread leaves a release to the leader with `os`. A leader that sleeps is in time: it has the
// thread's priority. One in a short job comes a little later.
constexpr Duration kPatience = 200 * kMicrosecond;

}  // namespace

Engine::Engine(std::unique_ptr<sched::Scheduler> scheduler, EngineOptions options)
    : options_(std::move(options)),
      realtime_(os() || options_.realtime_threads),
      lock_(realtime_ || options_.waits_priority > 0, LockClass::Bounded),
      scheduler_(std::move(scheduler)),
      pool_(os() ? options_.config.max_started : options_.config.workers + options_.spare_threads,
            options_.trace_capacity),
      tasks_(options_.measure, options_.misses != nullptr),
      lookout_(posts_silently() ? std::make_unique<HelperThread>() : nullptr),
      devices_(scheduler_->devices()),
      waiting_(devices_),
      placement_(pool_, waiting_, os(), options_.band, lookout_ ? &lookout_->parker : nullptr,
                 os() ? sched::kNoLimit : options_.spare_threads),
      decisions_(options_.trace_capacity),
      order_({lock_, *scheduler_, tasks_, placement_}, options_.config.policy) {
  const sched::Config &config = options_.config;
  REDAG_CHECK(!os() || config.max_started >= config.workers, "mode os needs at least one thread for every processor");
  REDAG_CHECK(!os() || options_.spins == 0, "spinning threads would keep others off their processors in mode os");
  if (options_.trace_capacity == 0 && trace::tap() == nullptr) {
    const JobEventKind counted = options_.measure ? JobEventKind::Preempted : JobEventKind::Skipped;
    scheduler_->record_only({JobEventKind::Skipped, counted});
  }
  REDAG_CHECK(!shares_order() || options_.band.shared, "the band of a shared order is shared");
}

Engine::~Engine() {
  halt();
  join();
}

// ---- threads ----

Result<void> Engine::start() {
  std::vector<int> cpus = options_.cpus;
  usable_ = usable_cpus();
  if (os() && cpus.empty()) {
    // The kernel runs the m most urgent threads only if it has exactly m processors to choose from. The last ones are
    // taken, because the first ones serve most interrupts.
    const std::size_t workers = options_.config.workers;
    if (workers <= usable_.size()) cpus.assign(usable_.end() - static_cast<std::ptrdiff_t>(workers), usable_.end());
  }
  if (Result<void> started = start_threads(cpus); !started) {
    // No thread has a job: none starts before running_ is set.
    end_threads();
    pool_.reset();
    return started;
  }
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  if (os()) order_.move_releases(releases_);
  placement_.start(cpus.empty() ? usable_.size() : std::min(cpus.size(), usable_.size()));
  running_ = true;
  decide(locked, at);
  return {};
}

Result<void> Engine::start_threads(const std::vector<int> &cpus) {
  const ThreadSetup setup{options_.name, realtime_ ? options_.band.top_job : 0, cpus, options_.touched_stack};
  Result<void> started = pool_.start(setup, [this](WorkerThread &self) { main(self); });
  if (started && shares_order()) {
    started = order_.start(options_.order_folder, options_.band.top_job, options_.name + "-order");
  }
  if (started && lookout_) {
    const int priority = os() ? options_.band.timer : 0;
    started = lookout_->start({options_.name + "-lookout", priority, {}}, [this] { look_out(); });
  }
  return started;
}

void Engine::end_threads() {
  pool_.end();
  order_.end();
  if (lookout_) lookout_->end();
}

void Engine::main(WorkerThread &self) noexcept {
  for (;;) {
    // Read before the mail: all mail was posted before this was set.
    const bool ending = pool_.ending();
    if (self.take_mail()) {
      Taker taker{.thread = self, .below = {}, .takes_any = true, .next = {Next::Kind::Start, self.mail}};
      self.meter.pass();
      run(taker, now());
    } else if (ending) {
      return;
    }
    // Mail that came meanwhile is not taken without a token: if it is silent, it is left to others.
    if (!pool_.ending()) idle(self);
  }
}

// Sleeps until there is a token.
void Engine::idle(WorkerThread &self) noexcept {
  if (self.leads.load(std::memory_order_relaxed)) {
    lead(self);
  } else {
    if (self.led) follow(self);
    self.parker.park(options_.spins);
  }
}

// The leader releases what is due, and often gets one of these jobs itself: no thread has to wake another one. An
// ordinary thread is not sure to get a processor in time, because the kernel can let a thread that it woke preempt it
// for a whole job. There the release thread wakes up as well, and the first of the two makes the release.
void Engine::lead(WorkerThread &self) noexcept {
  self.led = true;
  for (;;) {
    self.wakes_at.store(0, std::memory_order_relaxed);
    const Time next = releases_->lead(os() ? kPatience : 0);
    self.wakes_at.store(next == kNever ? kNever : next - origin_.load(std::memory_order_relaxed),
                        std::memory_order_relaxed);
    static_cast<void>(self.parker.spin(options_.spins));
    if (next == kNever) return self.parker.park();
    if (self.parker.park_until(next)) return;
  }
}

// Lets the release thread make the next release. Not done for a short job: the thread is probably the leader again
// after it, and each move of the release thread's alarm can take longer than the job.
void Engine::follow(WorkerThread &self) noexcept {
  self.led = false;
  releases_->follow();
}

void Engine::join() {
  halt();
  {
    // A decision that was under way has posted its jobs. No later one starts a job.
    Locked locked(*this);
    withdraw_if_halting(locked);
    pool_.forget_processors();
  }
  if (lets_wait_) static_cast<void>(wait_idle(kNever));  // a job that waits has no thread that would end after it
  end_threads();
  if (lets_wait_) end_waits();
}

// The lookout: sleeps until it is woken because mail is silent, then looks at intervals while that goes on.
void Engine::look_out() noexcept {
  for (bool again = false;;) {
    if (again) {
      lookout_->parker.park_until(monotonic_now() + Mailboxes::kLookInterval);
    } else {
      lookout_->parker.park();
    }
    if (lookout_->ending()) return;
    Locked locked(*this);
    withdraw_if_halting(locked);
    if (placement_.take_deferred()) decide(locked, now());
    again = placement_.look(locked.wake_ups());
  }
}

// ---- decisions ----

// `taker` is the calling thread, or null if it cannot take a job.
void Engine::decide(Locked &locked, Time now, Taker *taker) {
  // While paused, only run_one() starts a job, on the caller's thread.
  const std::uint32_t for_caller = taker != nullptr && &taker->thread == &pool_.caller() ? 1 : 0;
  carry_out(locked, scheduler_->dispatch(now, std::max(most_to_start(), for_caller)), now, taker);
}

// Passes a step of the scheduler on to the threads.
void Engine::carry_out(Locked &locked, const sched::Step &step, Time now, Taker *taker, Sender sender) {
  if (!step.events.empty()) report(locked, step.events);
  if (taker != nullptr || !step.dispatches.empty()) {
    const bool may_lead = releases_ != nullptr && releases_->expects();
    placement_.place(step, Situation{now, locked.waited(), may_lead, sender}, taker, tasks_, locked.wake_ups());
  }
  if (options_.config.preemption == sched::Preemption::Cooperative) refresh_outranked();
  if (waiting_.has_cancelled()) wake_cancelled(locked, now);
}

void Engine::report(Locked &locked, std::span<const JobEvent> events) {
  const bool has_listeners = has_listeners_.load(std::memory_order_relaxed);
  const trace::Tap *const tap = trace::tap();
  for (const JobEvent &event : events) {
    if (tap != nullptr) tap->event(this, event);
    if (options_.trace_capacity > 0) decisions_.push(event);
    if (options_.measure && event.kind == JobEventKind::Preempted) ++tasks_[event.task].preemptions;
    if (event.kind != JobEventKind::Skipped) continue;
    if (options_.misses != nullptr &&
        options_.misses->note({event.time, 0, event.task, event.job, MissKind::Skipped, event.reason})) {
      locked.wake_ups().wake_late(options_.misses->parker());
    }
    if (!has_listeners) continue;
    const auto &listener = tasks_[event.task].listener;
    if (listener) locked.tell(listener, event.reason);
  }
}

// Updates the flags that let a preemption point cost one load while no job is more urgent.
void Engine::refresh_outranked() {
  for (const auto &thread : pool_.threads()) {
    const bool outranked = may_start() && !thread->stack.empty() && scheduler_->outranked(thread->stack.back().slot);
    thread->outranked.store(outranked, std::memory_order_relaxed);
  }
}

// ---- events from outside ----

void Engine::release(std::span<const Release> releases) {
  const Time at = now();
  Locked locked(*this, releases.size());
  withdraw_if_halting(locked);
  if (halted_at_ != kNever) return;
  const Sender sender = lookout_ ? note_release(at) : nullptr;
  do {
    const auto lot = releases.first(std::min(releases.size(), sched::kMostReleasesAtOnce));
    for (const Release &release : lot) scheduler_->release(release.task, release.nominal, at, release.origin);
    decide_after_release(locked, at, sender, TaskId());
    releases = releases.subspan(lot.size());
  } while (!releases.empty());
}

void Engine::release(const Release &release, Time at) {
  Locked locked(*this);
  withdraw_if_halting(locked);
  if (halted_at_ != kNever) return;
  const Sender sender = lookout_ ? note_release(at) : nullptr;
  scheduler_->release(release.task, release.nominal, at, release.origin);
  decide_after_release(locked, at, sender, release.task);
}

// Mostly all workers have jobs, and nothing is to be done. A job of `task` that is not more urgent than that of the
// sender can wait for the decision at the end of the latter: this spares mail, and a thread that takes it.
[[gnu::always_inline]] inline void Engine::decide_after_release(Locked &locked, Time at, Sender sender, TaskId task) {
  const bool can_wait = sender != nullptr && task.valid() && placement_.unfinished() < options_.config.workers &&
                        may_hand_over() && options_.trace_capacity == 0 && trace::tap() == nullptr &&
                        may_wait_for(sender, scheduler_->level(task));
  const bool waits = can_wait && placement_.defer(at, locked.wake_ups());
  const sched::Step step = scheduler_->dispatch(at, waits ? 0 : most_to_start());
  if (!step.events.empty() || !step.dispatches.empty() || !may_hand_over())
    carry_out(locked, step, at, nullptr, sender);
}

void Engine::receive(const Release &message, Time at) {
  const RunningJob *const job = current_job();
  Locked locked(*this);
  withdraw_if_halting(locked);
  if (halted_at_ != kNever) return;
  const Sender sender = lookout_ ? note_release(at) : nullptr;
  scheduler_->receive(message.task, job == nullptr ? TaskId() : job->job.task, message.nominal, at, message.origin);
  decide_after_release(locked, at, sender, message.task);
}

// Notes when the calling job first releases another. Returns its thread if it is expected to end soon and then takes a
// job: one that has a job below does not.
Sender Engine::note_release(Time at) {
  RunningJob *const job = RunningJob::current();
  if (job == nullptr || job->engine != this || job->below != nullptr) return nullptr;
  if (!job->has_released) job->released = at;
  job->has_released = true;
  const bool soon = job->thread < pool_.size() && tasks_[job->job.task].releases_at_end();
  return soon ? &pool_[job->thread] : nullptr;
}

void Engine::miss(std::span<const Release> releases, Reason reason) {
  const Time at = now();
  while (!releases.empty()) {
    Locked locked(*this);
    withdraw_if_halting(locked);
    if (halted_at_ != kNever) return;
    const auto lot = releases.first(std::min(releases.size(), sched::kMostReleasesAtOnce));
    for (const Release &release : lot) scheduler_->miss(release.task, release.nominal, at, reason);
    decide(locked, at);
    locked.tell_nobody();
    releases = releases.subspan(lot.size());
  }
}

// ---- pauses ----

void Engine::pause() {
  Locked locked(*this);
  paused_ = true;
  refresh_outranked();
  if (pause_waiters_ > 0) wake_pause_waiters();
}

void Engine::resume() {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  paused_ = false;
  if (pause_waiters_ > 0) wake_pause_waiters();
  decide(locked, at);
}

bool Engine::wait_paused(Time deadline) {
  for (bool in_time = true;;) {
    std::uint32_t seen = 0;
    {
      Locked locked(*this);
      if (!paused_) return false;
      if (placement_.unfinished() == 0) return true;
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
  Taker taker{.thread = pool_.caller(), .below = {}, .takes_any = false};
  {
    const Time at = now();
    Locked locked(*this);
    withdraw_if_halting(locked);
    REDAG_CHECK(paused_, "run_one() is for a paused engine");
    REDAG_CHECK(pool_.caller().stack.empty(), "one run_one() at a time");
    decide(locked, at, &taker);
  }
  if (taker.next.kind != Next::Kind::Start) return false;
  pool_.caller().meter.forget();
  run(taker, now());
  return true;
}

// ---- the end ----

// The first thread to take the lock after halt() skips the jobs that have not started. These skips are the engine's,
// not the model's: they are not recorded, and the jobs count as in flight. Jobs that wait are woken. halt() takes no
// lock, so each thread asks once, when it has taken the lock: no event is undecided then, and no job is half woken.
void Engine::withdraw(Locked &locked) {
  halted_at_ = now();
  scheduler_->close(halted_at_);
  const sched::Step step = scheduler_->dispatch(halted_at_);
  for (const JobEvent &event : step.events) {
    if (event.kind == JobEventKind::Skipped) ++tasks_[event.task].withdrawn;
  }
  REDAG_CHECK(step.dispatches.empty(), "a job was started after the end");
  waiting_.cancel_all();
  if (waiting_.has_cancelled()) wake_cancelled(locked, halted_at_);
}

bool Engine::wait_idle(Time deadline) {
  {
    Locked locked(*this);
    withdraw_if_halting(locked);
    REDAG_CHECK(halted_at_ != kNever, "wait_idle() is for after halt()");
    if (placement_.unfinished() == 0) return true;
  }
  return idle_event_.wait_until(deadline);
}

// ---- what can be asked ----

std::uint64_t Engine::thread_waits() const {
  const LockGuard guard(lock_);
  return scheduler_->thread_waits();
}

std::vector<Problem> Engine::problems() const {
  std::uint64_t refused = 0;
  std::uint64_t waits = 0;
  std::string of_order;
  {
    const LockGuard guard(lock_);
    refused = placement_.refused_priorities();
    waits = scheduler_->thread_waits();
    of_order = order_.problem();
  }
  std::vector<Problem> problems;
  if (refused > 0) {
    problems.push_back({fmt::format("the system refused {} changes of a thread's priority, so jobs may wait for less "
                                    "urgent ones (the process needs the right to real-time priorities, CAP_SYS_NICE or "
                                    "rtprio, for as long as it runs)",
                                    refused),
                        true});
  }
  if (!of_order.empty()) problems.push_back({of_order, true});
  if (waits > 0) {
    problems.push_back(
        {fmt::format("jobs waited for a thread {} times, because all {} threads had jobs in progress (raise 'threads')",
                     waits, pool_.size())});
  }
  return problems;
}

Time Engine::halted_at() const {
  const LockGuard guard(lock_);
  return halted_at_;
}

std::vector<Job> Engine::started() const {
  const LockGuard guard(lock_);
  std::vector<Job> jobs;
  for (const auto &thread : pool_.threads()) jobs.insert(jobs.end(), thread->stack.begin(), thread->stack.end());
  jobs.insert(jobs.end(), pool_.caller().stack.begin(), pool_.caller().stack.end());
  waiting_.for_each([&](const WaitingJob &waiting) { jobs.push_back(waiting.job); });
  return jobs;
}

void Engine::drain(std::vector<JobEvent> &out, bool last) {
  decisions_.drain(merge_.decisions());
  for (auto &thread : pool_.threads()) thread->events.drain(merge_.started());
  pool_.caller().events.drain(merge_.started());
  merge_.merge(out, last);
}

std::uint64_t Engine::lost_events() const {
  if (options_.trace_capacity == 0) return 0;
  std::uint64_t lost = decisions_.dropped();
  for (const auto &thread : pool_.threads()) lost += thread->events.dropped();
  lost += pool_.caller().events.dropped();
  return lost;
}

}  // namespace redag::runtime
