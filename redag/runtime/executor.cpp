// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <type_traits>
#include <utility>

#include "redag/base/atomic.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/text.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag/live/publisher.hpp"
#include "redag/model/validate.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/dag_mistakes.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/live_sample.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/runtime/setup.hpp"
#include "redag/runtime/spins.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/runtime/watchdog.hpp"
#include "redag/sched/priority_scheduler.hpp"

namespace redag::runtime {
namespace {

constexpr Duration kStartMargin = kMillisecond;  // from all threads being ready to the first release
constexpr std::size_t kMaxTraceCapacity = std::size_t{1} << 28U;
constexpr double kMaxWatchedDeadlines = 1e6;

[[noreturn]] void refuse(const std::string &what) { throw std::invalid_argument(what); }

template <class Number>
void check_range(const char *option, Number value, std::type_identity_t<Number> least,
                 std::type_identity_t<Number> most) {
  if (value >= least && value <= most) return;
  refuse(fmt::format("ExecutorOptions::{} must be from {} to {}, not {}", option, least, most, value));
}

void check_duration(const char *option, nanoseconds value) {
  if (value.count() >= 0 && value.count() <= kMaxDuration) return;
  refuse(fmt::format("ExecutorOptions::{} must be from 0s to {}, not {}", option, kMaxDurationText,
                     format_duration(value.count())));
}

void check(const ExecutorOptions &options) {
  if (const std::string why = name_mistake(options.name); !why.empty()) {
    refuse(fmt::format("ExecutorOptions::name {} {}", in_quotes(options.name), why));
  }
  check_range("workers", options.workers, 0U, kMaxWorkers);
  check_range("threads", options.threads, 0U, 2 * kMaxWorkers);
  if (options.threads > 0 && options.threads < options.workers) {
    refuse(fmt::format("ExecutorOptions::threads is {}, but must be 0 or at least {}, the number of workers",
                       options.threads, options.workers));
  }
  check_range("trace_capacity", options.trace_capacity, std::size_t{0}, kMaxTraceCapacity);
  check_duration("spin", options.spin);
  check_duration("stop_timeout", options.stop_timeout);
  if (!options.watchdog) return;
  const WatchLimits &limits = options.watchdog->limits;
  check_duration("watchdog: limits.longest", nanoseconds(limits.longest));
  check_duration("watchdog: interval", nanoseconds(options.watchdog->interval));
  check_range("watchdog: limits.deadlines", limits.deadlines, 0.0, kMaxWatchedDeadlines);
  if (limits.longest == 0 && limits.deadlines == 0) {
    refuse(
        "ExecutorOptions::watchdog: no job would be overdue (set limits.longest or limits.deadlines to a value greater "
        "than 0)");
  }
}

}  // namespace

class Executor::Impl {
 public:
  explicit Impl(ExecutorOptions options);
  ~Impl();
  Impl(const Impl &) = delete;
  Impl &operator=(const Impl &) = delete;

  DagId add(Dag dag, std::vector<DagBuilder::Function> functions);
  void remove(DagId dag);
  void run_for(nanoseconds duration);
  void start();
  void wait();
  void stop();
  void request_stop() noexcept;
  void drain(std::vector<JobEvent> &events);
  [[nodiscard]] std::vector<TaskStats> stats(DagId dag) const;
  [[nodiscard]] std::string task_name(TaskId task) const;
  [[nodiscard]] const Setup &setup() const { return setup_; }
  [[nodiscard]] const Engine &engine() const { return *engine_; }

 private:
  struct Added {
    std::string name;
    std::vector<Task> tasks;
    std::uint32_t max_active = 0;
    AddedDag ids;          // the engine's ids
    std::size_t left = 0;  // how many of the tasks' ids no later task has
    bool removed = false;
    Dag dag;  // for `admission` only
  };
  struct Owner {
    DagId dag;  // the executor's id, not the engine's
    std::uint32_t position = 0;
    Time since = 0;  // jobs released earlier belong to a former task with this id
  };
  void finish();
  void admit(const Dag &dag) const REDAG_REQUIRES(lock_);
  void on_overdue(const OverdueJob &job);
  [[nodiscard]] Result<void> start_threads();
  [[nodiscard]] Result<void> start_watchdog();
  void sample(live::Sample &sample) const;
  void on_exception(const Job &job, std::exception_ptr exception);
  void own(DagId dag, const std::vector<TaskId> &tasks, Time since) REDAG_REQUIRES(lock_);
  [[nodiscard]] std::string name_of(const Owner &owner) const REDAG_REQUIRES(lock_);

  ExecutorOptions options_;
  Setup setup_;
  std::unique_ptr<Engine> engine_;
  std::unique_ptr<ReleaseTimer> timer_;
  std::unique_ptr<Watchdog> watchdog_;  // from start() until no body is left
  mutable PiMutex lock_;
  // Without a trace the engine uses ids again. Memory then does not grow with the number of former DAGs.
  std::map<std::uint32_t, Added> dags_ REDAG_GUARDED_BY(lock_);  // by DagId
  std::uint32_t next_dag_ REDAG_GUARDED_BY(lock_) = 0;
  std::vector<Owner> owners_ REDAG_GUARDED_BY(lock_);   // by TaskId
  std::exception_ptr failure_ REDAG_GUARDED_BY(lock_);  // the first exception that stopped the executor
  bool running_ REDAG_GUARDED_BY(lock_) = false;
  Mutex finishing_;  // held by the one thread that begins or ends the run
  Atomic<bool> started_{false};
  Atomic<bool> finished_{false};
  Event stop_;
  std::unique_ptr<live::Publisher> live_;  // last: asks for figures until it is destroyed
};

Executor::Impl::Impl(ExecutorOptions options) : options_(std::move(options)) {
  check(options_);
  Result<Setup> setup = set_up({.preemption = options_.preemption,
                                .policy = options_.policy,
                                .ties = options_.ties,
                                .workers = options_.workers,
                                .threads = options_.threads,
                                .cpus = options_.cpus});
  if (!setup) throw std::runtime_error(to_string(setup.error()));
  setup_ = *std::move(setup);
  options_.workers = setup_.config.workers;
  if (options_.lock_memory) {
    if (const Result<void> locked = redag::runtime::lock_memory(); !locked) {
      setup_.warnings.push_back(to_string(locked.error()));
    }
  }

  EngineOptions engine;
  engine.name = options_.name;
  engine.config = setup_.config;
  engine.config.reuse_ids = options_.trace_capacity == 0;  // in a trace an id means one task
  engine.band = setup_.band;
  engine.throttling = setup_.throttling;
  engine.cpus = options_.cpus;
  engine.trace_capacity = options_.trace_capacity;
  engine.measure = options_.live;
  engine.spins = spins_before_sleep(setup_, options_.spin.count());
  if (options_.lock_memory) engine.touched_stack = kTouchedStack;
  engine.on_exception = [this](const Job &job, std::exception_ptr e) { on_exception(job, std::move(e)); };
  auto scheduler = std::make_unique<sched::PriorityScheduler>(Workload{}, engine.config);
  engine_ = std::make_unique<Engine>(std::move(scheduler), std::move(engine));
  timer_ = std::make_unique<ReleaseTimer>([this](auto releases) { engine_->release(releases); }, 0);
  engine_->share_releases(timer_->thread());
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
  request_stop();
  timer_->join();
  // The watchdog watches until no body runs.
  if (watchdog_) (void)engine_->wait_idle(kNever);
  watchdog_.reset();
  engine_->join();
}

DagId Executor::Impl::add(Dag dag, std::vector<DagBuilder::Function> functions) {
  inherit_periods(dag);
  if (const std::string mistakes = mistakes_of(dag, options_.policy); !mistakes.empty()) {
    refuse("Executor::add(): " + mistakes);
  }

  std::vector<Body> bodies;
  for (DagBuilder::Function &body : functions) {
    bodies.emplace_back([function = std::move(body)](const Job &) {
      function();
      return sched::Outcome::Finished;
    });
  }
  const LockGuard guard(lock_);
  const auto has_name = [&](const auto &added) { return !added.second.removed && added.second.name == dag.name; };
  if (std::any_of(dags_.begin(), dags_.end(), has_name)) {
    refuse("Executor::add(): " + place_of(dag.name) +
           ": another DAG in the executor has this name (remove() that one first, or choose another name)");
  }
  if (options_.admission) admit(dag);
  const DagId id(next_dag_);
  Added added{dag.name, dag.tasks, dag.max_active, engine_->add_dag(dag, std::move(bodies)), 0, false, {}};
  if (options_.admission) added.dag = dag;
  const Time now = running_ ? std::max<Time>(0, engine_->now()) : 0;
  own(id, added.ids.tasks, now);
  added.left = added.ids.tasks.size();
  timer_->add(dag, added.ids.tasks, now);
  dags_.emplace(id.value, std::move(added));
  ++next_dag_;
  return id;
}

// Records which task owns each id. A DAG's record is erased once later tasks own all of its ids.
void Executor::Impl::own(DagId dag, const std::vector<TaskId> &tasks, Time since) {
  for (std::uint32_t position = 0; position < tasks.size(); ++position) {
    const std::uint32_t task = tasks[position].value;
    if (task >= owners_.size()) {
      owners_.resize(task + 1);
    } else if (const auto former = dags_.find(owners_[task].dag.value); former != dags_.end()) {
      if (--former->second.left == 0) dags_.erase(former);
    }
    owners_[task] = Owner{dag, position, since};
  }
}

void Executor::Impl::admit(const Dag &dag) const {
  Workload workload;
  workload.name = options_.name;
  workload.platform = Platform{options_.workers, setup_.mode.mode};
  workload.policy = options_.policy;
  workload.ties = options_.ties;
  for (const auto &[id, other] : dags_) {
    if (!other.removed) workload.dags.push_back(other.dag);
  }
  workload.dags.push_back(dag);
  if (const Result<void> admitted = options_.admission(workload, engine_->options().config); !admitted) {
    throw AdmissionRefused(fmt::format("DAG '{}' is not admitted: {}", dag.name, to_string(admitted.error())));
  }
}

void Executor::Impl::remove(DagId dag) {
  DagId removed;
  {
    const LockGuard guard(lock_);
    if (dag.value >= next_dag_)
      throw std::out_of_range(fmt::format("Executor::remove(): there is no DAG {}", dag.value));
    const auto found = dags_.find(dag.value);
    if (found == dags_.end() || found->second.removed) return;
    Added &gone = found->second;
    gone.removed = true;
    timer_->remove(gone.ids.tasks);
    removed = gone.ids.dag;
  }
  engine_->remove_dag(removed);  // destroys bodies, which may own anything: not under lock_
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
  const LockGuard guard(lock_);
  const Time origin = monotonic_now() + kStartMargin;
  engine_->set_origin(origin);
  running_ = true;
  timer_->begin(origin, kNever);
}

// The release timer waits for begin(), which comes once all threads exist. If a thread cannot be created, the caller
// may catch the exception and start again.
Result<void> Executor::Impl::start_threads() {
  const Result<void> timing = timer_->start(ThreadSetup{options_.name + "-timer", setup_.timer_priority(), {}});
  if (!timing) return timing;
  if (const Result<void> watching = start_watchdog(); !watching) return watching;
  return engine_->start();
}

Result<void> Executor::Impl::start_watchdog() {
  if (!options_.watchdog || watchdog_) return {};
  auto watchdog =
      std::make_unique<Watchdog>(*engine_, *options_.watchdog, [this](const OverdueJob &job) { on_overdue(job); });
  Result<void> watching = watchdog->start({options_.name + "-watch", setup_.timer_priority(), {}});
  if (watching) watchdog_ = std::move(watchdog);
  return watching;
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
  if (options_.on_overdue) {
    options_.on_overdue(info);
  } else {
    std::fprintf(stderr, "%s: %s\n", options_.name.c_str(), info.text.c_str());
  }
}

void Executor::Impl::request_stop() noexcept {
  engine_->halt();
  timer_->stop();
  stop_.set();
}

void Executor::Impl::wait() {
  if (engine_->in_body()) {
    throw std::logic_error(
        "Executor::wait(): a body cannot wait for the end of its own executor (call stop() instead)");
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
  if (started_ && !engine_->in_body()) finish();
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
  watchdog_.reset();
  engine_->join();
  live_.reset();
  finished_ = true;
}

void Executor::Impl::on_exception(const Job &job, std::exception_ptr exception) {
  if (options_.on_exception) {
    const ExceptionInfo info{task_name(job.task), job.number, exception};
    if (options_.on_exception(info) == OnException::Continue) return;
  }
  {
    const LockGuard guard(lock_);
    if (!failure_) failure_ = std::move(exception);
  }
  request_stop();
}

// ---- what can be asked ----

void Executor::Impl::drain(std::vector<JobEvent> &events) { engine_->drain(events, finished_); }

std::vector<TaskStats> Executor::Impl::stats(DagId dag) const {
  const LockGuard guard(lock_);
  const auto found = dags_.find(dag.value);
  if (found == dags_.end()) throw std::out_of_range(fmt::format("Executor::stats(): there is no DAG {}", dag.value));
  const Added &of = found->second;
  if (of.left < of.tasks.size()) {
    throw std::out_of_range(fmt::format("Executor::stats(): DAG {} was removed, and its slot is reused", dag.value));
  }
  std::vector<TaskStats> result;
  for (std::size_t i = 0; i < of.tasks.size(); ++i) {
    const TaskId task = of.ids.tasks[i];
    result.push_back(TaskStats{of.name + "." + of.tasks[i].name, engine_->accounting(task), engine_->usage(task)});
  }
  return result;
}

std::string Executor::Impl::task_name(TaskId task) const {
  const LockGuard guard(lock_);
  if (task.value >= owners_.size()) return fmt::format("task {}", task.value);
  return name_of(owners_[task.value]);
}

std::string Executor::Impl::name_of(const Owner &owner) const {
  const Added &dag = dags_.at(owner.dag.value);  // exists as long as it owns a task
  return dag.name + "." + dag.tasks[owner.position].name;
}

void Executor::Impl::sample(live::Sample &sample) const {
  const LockGuard guard(lock_);
  for (const auto &[number, dag] : dags_) {
    if (dag.removed) continue;
    sample.dags.push_back({dag.name, dag.max_active});
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
      const TaskId id = dag.ids.tasks[i];
      live::TaskSample task;
      fill(task, engine_->figures(id));
      task.key = id.value;
      task.name = dag.tasks[i].name;
      task.dag = static_cast<std::uint32_t>(sample.dags.size() - 1);
      task.period = dag.tasks[i].period;
      task.deadline = dag.tasks[i].deadline;
      sample.tasks.push_back(std::move(task));
    }
  }
}

// ---- the interface ----

Executor::Executor(ExecutorOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}
Executor::~Executor() = default;
DagId Executor::add(DagBuilder dag) { return impl_->add(std::move(dag.dag_), std::move(dag.bodies_)); }
void Executor::remove(DagId dag) { impl_->remove(dag); }
void Executor::run() {
  impl_->start();
  impl_->wait();
}
void Executor::run_for(nanoseconds duration) { impl_->run_for(duration); }
void Executor::start() { impl_->start(); }
void Executor::wait() { impl_->wait(); }
void Executor::stop() { impl_->stop(); }
void Executor::request_stop() noexcept { impl_->request_stop(); }
bool Executor::stopping() const noexcept { return impl_->engine().halting(); }
const Mode &Executor::mode() const { return impl_->setup().mode; }
const std::vector<std::string> &Executor::warnings() const { return impl_->setup().warnings; }
const sched::Config &Executor::config() const { return impl_->engine().options().config; }
void Executor::drain(std::vector<JobEvent> &events) { impl_->drain(events); }
Time Executor::stopped_at() const { return impl_->engine().halted_at(); }
std::uint64_t Executor::lost_events() const { return impl_->engine().lost_events(); }
std::uint64_t Executor::thread_waits() const { return impl_->engine().thread_waits(); }
std::vector<TaskStats> Executor::stats(DagId dag) const { return impl_->stats(dag); }
std::string Executor::task_name(TaskId task) const { return impl_->task_name(task); }

}  // namespace redag::runtime
