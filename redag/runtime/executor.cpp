// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <stdexcept>
#include <utility>

#include "redag/runtime/executor_impl.hpp"
#include "redag/runtime/live_sample.hpp"
#include "redag/runtime/spins.hpp"
#include "redag/runtime/stop_signals.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {
namespace {

constexpr Duration kStartMargin = kMillisecond;                // from all threads being ready to the first release
constexpr std::size_t kRecordedTrace = std::size_t{1} << 15U;  // events in each ring, for `record`

}  // namespace

Executor::Impl::Impl(ExecutorOptions options) : options_(std::move(options)) {
  check(options_);
  Result<Setup> setup = set_up({.preemption = options_.preemption,
                                .policy = options_.policy,
                                .ties = options_.ties,
                                .workers = options_.workers,
                                .threads = options_.threads,
                                .cpus = options_.cpus,
                                .share_order = options_.share_order});
  if (!setup) throw std::runtime_error(to_string(setup.error()));
  setup_ = *std::move(setup);
  options_.workers = setup_.config.workers;
  if (options_.lock_memory) {
    if (const Result<void> locked = redag::runtime::lock_memory(); !locked) {
      setup_.warnings.push_back(to_string(locked.error()));
    }
  }

  if (!options_.record.empty()) {
    Result<std::unique_ptr<Recorder>> recorder = Recorder::create(options_.record, options_.record_bytes);
    if (!recorder) throw std::runtime_error(to_string(recorder.error()));
    recorder_ = *std::move(recorder);
    if (options_.trace_capacity == 0) options_.trace_capacity = kRecordedTrace;
    if (const std::string &aside = recorder_->moved_aside(); !aside.empty()) {
      setup_.warnings.push_back(fmt::format(
          "an earlier run did not end normally; its record is now '{0}' ('redag why {0}' explains it)", aside));
    }
  }
  if (options_.on_deadline_miss) {
    misses_ = std::make_unique<MissReporter>(
        [this](const Miss &miss, std::uint64_t unreported) { on_miss(miss, unreported); });
  }

  EngineOptions engine;
  engine.name = options_.name;
  engine.config = setup_.config;
  engine.config.reuse_ids = options_.trace_capacity == 0;  // in a trace an id means one task
  engine.band = setup_.band;
  engine.order_folder = setup_.order_folder;
  engine.cpus = options_.cpus;
  engine.trace_capacity = options_.trace_capacity;
  engine.measure = options_.live || options_.measure;
  if (misses_) engine.misses = &misses_->log();
  engine.spare_threads = setup_.spare_threads;
  engine.spins = spins_before_sleep(setup_, options_.spin.count());
  if (options_.lock_memory) engine.touched_stack = kTouchedStack;
  engine.on_exception = [this](const Job &job, std::exception_ptr e) { on_exception(job, std::move(e)); };
  engine.waits_priority = setup_.timer_priority();
  Workload empty;
  empty.platform.devices = options_.devices;
  auto scheduler = std::make_unique<sched::PriorityScheduler>(empty, engine.config);
  engine_ = std::make_unique<Engine>(std::move(scheduler), std::move(engine));
  timer_ = std::make_unique<ReleaseTimer>([this](auto releases) { engine_->release(releases); }, 0);
  engine_->share_releases(timer_->thread());
  if (options_.watchdog) {
    watchdog_ =
        std::make_unique<Watchdog>(*engine_, *options_.watchdog, [this](const OverdueJob &job) { on_overdue(job); });
  }
  if (!options_.live) return;
  auto publisher = live::Publisher::start(live_options(options_.name, "threads", setup_.mode, setup_.config),
                                          [this](live::Sample &sample) { this->sample(sample); });
  if (publisher) {
    live_ = *std::move(publisher);
  } else {
    setup_.warnings.push_back(to_string(publisher.error()));
  }
}

Executor::Impl::~Impl() {
  disconnect_sources();
  request_stop();
  timer_->join();
  // The watchdog watches until no body runs.
  if (watchdog_) {
    static_cast<void>(engine_->wait_idle(kNever));
    watchdog_->stop();
  }
  engine_->join();
  if (misses_) misses_->stop();
  finish_record();
}

// ---- the run ----

void Executor::Impl::run_for(nanoseconds duration) {
  if (duration.count() < 0) {
    refuse(fmt::format("Executor::run_for(): the duration {} is negative", format_duration(duration.count())));
  }
  start();
  stop_.wait_until(monotonic_now() + std::min<Duration>(duration.count(), kMaxDuration / 2));
  request_stop();
  wait();
}

void Executor::Impl::start() {
  const LockGuard starting(finishing_);  // a concurrent stop() waits until the run has begun
  if (started_.exchange(true))
    throw std::logic_error("Executor::start(): the executor was started before (an Executor runs only once)");
  if (const Result<void> ready = start_threads(); !ready) {
    started_ = false;
    throw std::runtime_error(to_string(ready.error()));
  }
  const Time origin = monotonic_now() + kStartMargin;
  // A program that releases jobs itself may begin to do so when start() returns: time 0 is then over.
  if (begin(origin)) static_cast<void>(stop_.wait_until(origin));
}

// Returns true if there are tasks that the program releases.
bool Executor::Impl::begin(Time origin) {
  const LockGuard guard(lock_);
  engine_->set_origin(origin);
  running_ = true;
  bool has_events = false;
  for (const auto &[id, added] : dags_) {
    for (const auto &source : added.sources) {
      if (source == nullptr || added.removed) continue;
      source->open();
      has_events = true;
    }
  }
  timer_->begin(origin, kNever);
  return has_events;
}

// The release timer waits for begin(), which comes once all threads exist. If a thread cannot be created, the caller
// may catch the exception and start again.
Result<void> Executor::Impl::start_threads() {
  const Result<void> timing = timer_->start(ThreadSetup{options_.name + "-timer", setup_.timer_priority(), {}});
  if (!timing) return timing;
  if (watchdog_) {
    const Result<void> watching = watchdog_->start({options_.name + "-watch", setup_.timer_priority(), {}});
    if (!watching) return watching;
  }
  if (misses_) {
    const Result<void> reporting = misses_->start(ThreadSetup{options_.name + "-misses", setup_.timer_priority(), {}});
    if (!reporting) return reporting;
  }
  if (recorder_) {
    const Result<void> recording = recorder_->start(
        *engine_, [this] { return run_info(); }, options_.name);
    if (!recording) return recording;
  }
  return engine_->start();
}

void Executor::Impl::on_overdue(const OverdueJob &job) {
  OverdueInfo info{{}, job.job.number, job.elapsed, job.used, {}};
  {
    // The job may have ended since watch() saw it. Its id may be another task's.
    const LockGuard guard(lock_);
    const Owner &owner = owners_[job.job.task.value];
    info.task = job.job.release < owner.since ? "a removed task" : name_of(owner);
  }
  info.text = fmt::format("{} #{} is overdue: {}", info.task, info.job, describe(job));
  if (!options_.on_overdue) {
    std::fprintf(stderr, "%s: %s\n", options_.name.c_str(), info.text.c_str());
    return;
  }
  try {
    begin_unbounded_work();
    options_.on_overdue(info);
  } catch (...) {
    fail(std::current_exception());
  }
}

void Executor::Impl::request_stop() noexcept {
  engine_->halt();
  timer_->stop();
  stop_.set();
}

void Executor::Impl::wait() {
  if (is_own_thread()) {
    throw std::logic_error(
        "Executor::wait(): a body, on_deadline_miss or on_overdue cannot wait for the end of its own executor (call "
        "stop() instead)");
  }
  if (!started_) throw std::logic_error("Executor::wait(): the executor is not started (call start() first)");
  stop_.wait();
  finish();
  std::exception_ptr failure;
  {
    const LockGuard guard(lock_);
    failure = std::exchange(failure_, nullptr);
  }
  if (failure) std::rethrow_exception(failure);
}

void Executor::Impl::stop() {
  request_stop();
  if (started_ && !is_own_thread()) finish();
}

bool Executor::Impl::is_own_thread() const {
  return engine_->current_job() != nullptr || engine_->in_service() || (misses_ && misses_->is_this_thread()) ||
         (watchdog_ && watchdog_->is_this_thread());
}

void Executor::Impl::finish() {
  const LockGuard guard(finishing_);
  if (finished_) return;
  timer_->join();
  if (!engine_->wait_idle(monotonic_now() + options_.stop_timeout.count())) {
    std::vector<std::string> names;
    for (const Job &job : engine_->started()) names.push_back(task_name(job.task));
    throw std::runtime_error(fmt::format("bodies were still running {} after the stop: {}",
                                         format_duration(options_.stop_timeout.count()), fmt::join(names, ", ")));
  }
  if (watchdog_) watchdog_->stop();
  {
    const LockGuard adding(adding_);  // add() may create the engine's threads for waits
    engine_->join();
  }
  if (misses_) misses_->stop();
  live_.reset();
  finish_record();
  finished_ = true;
}

void Executor::Impl::finish_record() {
  if (!recorder_) return;
  const Result<void> written = recorder_->finish(engine_->halted_at());
  if (written) return;
  std::string warning = "the run is not recorded: " + to_string(written.error());
  std::fprintf(stderr, "%s: %s\n", options_.name.c_str(), warning.c_str());
  const LockGuard guard(lock_);
  setup_.warnings.push_back(std::move(warning));
}

void Executor::Impl::on_exception(const Job &job, std::exception_ptr exception) {
  if (options_.on_exception) {
    const ExceptionInfo info{task_name(job.task), job.number, exception};
    begin_unbounded_work();
    if (options_.on_exception(info) == OnException::Continue) return;
  }
  fail(std::move(exception));
}

// Stops the executor; wait() throws the first such exception.
void Executor::Impl::fail(std::exception_ptr exception) {
  {
    const LockGuard guard(lock_);
    if (!failure_) failure_ = std::move(exception);
  }
  request_stop();
}

void Executor::Impl::on_miss(const Miss &miss, std::uint64_t unreported) {
  MissInfo info{.task = {},
                .job = miss.job,
                .kind = miss.kind,
                .reason = miss.reason,
                .lateness = miss.lateness,
                .unreported = unreported,
                .text = {}};
  {
    // The task may have been removed since then. Its id may be another task's.
    const LockGuard guard(lock_);
    const Owner &owner = owners_[miss.task.value];
    info.task = miss.at < owner.since ? "a removed task" : name_of(owner);
  }
  const auto what = [&]() -> std::string {
    switch (miss.kind) {
      case MissKind::Late: return fmt::format("finished {} late", humanize_duration(miss.lateness));
      case MissKind::EndToEnd:
        return fmt::format("finished {} after the end-to-end deadline of its DAG", humanize_duration(miss.lateness));
      case MissKind::Skipped: return fmt::format("was skipped ({})", to_string(miss.reason));
      case MissKind::Aborted: return fmt::format("was aborted ({})", to_string(miss.reason));
    }
    return {};
  };
  info.text = fmt::format("{} #{} {}", info.task, info.job, what());
  try {
    begin_unbounded_work();
    options_.on_deadline_miss(info);
  } catch (...) {
    fail(std::current_exception());
  }
}

// ---- what can be asked ----

void Executor::Impl::drain(std::vector<JobEvent> &events) {
  if (recorder_) {
    throw std::logic_error("Executor::drain(): ExecutorOptions::record takes the events (read them from its files)");
  }
  engine_->drain(events, finished_);
}

// ---- the interface ----

Executor::Executor(ExecutorOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Executor::~Executor() = default;
DagId Executor::add(DagBuilder dag) {
  return impl_->add(std::move(dag.dag_), std::move(dag.bodies_), std::move(dag.sources_));
}
bool Executor::release(const EventHandle &event) { return event.source_->release(impl_->engine()); }
void Executor::remove(DagId dag) { impl_->remove(dag); }
void Executor::run() {
  impl_->start();
  impl_->wait();
}
int Executor::run_until_signal(std::initializer_list<int> signals) {
  const StopSignals stop_signals(*this, signals);
  run();
  return stop_signals.received();
}
void Executor::run_for(nanoseconds duration) { impl_->run_for(duration); }
void Executor::start() { impl_->start(); }
void Executor::wait() { impl_->wait(); }
void Executor::stop() { impl_->stop(); }
void Executor::request_stop() noexcept { impl_->request_stop(); }
bool Executor::stopping() const noexcept { return impl_->engine().halting(); }
const Mode &Executor::mode() const { return impl_->setup().mode; }
std::vector<std::string> Executor::warnings() const { return impl_->warnings(); }
const sched::Config &Executor::config() const { return impl_->engine().options().config; }
void Executor::drain(std::vector<JobEvent> &events) { impl_->drain(events); }
Time Executor::stopped_at() const { return impl_->engine().halted_at(); }
std::uint64_t Executor::lost_events() const { return impl_->engine().lost_events(); }
std::uint64_t Executor::thread_waits() const { return impl_->engine().thread_waits(); }
std::vector<TaskStats> Executor::stats(DagId dag) const { return impl_->stats(dag).tasks; }
DagStats Executor::dag_stats(DagId dag) const { return impl_->stats(dag); }
DeviceHandle Executor::device(std::string_view name) const { return impl_->device(name); }
std::string Executor::task_name(TaskId task) const { return impl_->task_name(task); }

}  // namespace redag::runtime
