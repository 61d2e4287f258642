// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "core.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>
#include <stdexcept>
#include <utility>

#include "middleware_report.hpp"
#include "middleware_threads.hpp"
#include "rcl/context.h"
#include "rclcpp/logging.hpp"
#include "redag/model/validate.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/executor_options.hpp"
#include "redag/runtime/live_sample.hpp"
#include "redag/runtime/spins.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/sched/priority_scheduler.hpp"

namespace redag_rclcpp {

using redag::kNever;
using redag::saturated_add;
using redag::Workload;
using redag::runtime::monotonic_now;
using std::chrono::nanoseconds;

namespace {

constexpr redag::Duration kNodesAppear = 3 * redag::kSecond;  // after the first start: until names should match
constexpr redag::Duration kThreadsAppear = redag::kSecond;    // after a start or new entities: of the middleware

rclcpp::Logger logger() { return rclcpp::get_logger("redag_rclcpp"); }

/// Checks and completes the workload. Throws std::runtime_error if the workload is invalid, std::invalid_argument for
/// other options.
ReDAGOptions prepare(ReDAGOptions options) {
  if (options.default_period <= nanoseconds(0)) {
    throw std::invalid_argument(
        "default_period must be greater than 0, because callbacks with shorter periods are more urgent");
  }
  if (options.spin < nanoseconds(0)) throw std::invalid_argument("spin must not be negative");
  if (options.watchdog < nanoseconds(0)) throw std::invalid_argument("watchdog must not be negative");
  redag::runtime::check_devices("ReDAGOptions::devices", options.devices);
  if (!options.workload) return options;
  const auto findings = redag::validate(*options.workload, redag::ValidateOptions{.wcet_optional = true});
  if (has_errors(findings)) throw std::runtime_error(to_string(findings));
  for (redag::Dag &dag : options.workload->dags) redag::inherit_periods(dag);
  return options;
}

redag::runtime::Setup set_up(const ReDAGOptions &options) {
  auto setup = redag::runtime::set_up({.preemption = options.preemption,
                                       .policy = options.policy,
                                       .ties = options.ties,
                                       .workers = options.workers,
                                       .threads = options.threads,
                                       .cpus = options.cpus,
                                       .share_order = options.share_order});
  if (!setup) throw std::runtime_error(to_string(setup.error()));
  return *std::move(setup);
}

/// True if libredag_pi.so is in the process and switched on.
bool locks_inherit() {
  void *const enabled = dlsym(RTLD_DEFAULT, "redag_pi_enabled");
  return enabled != nullptr && reinterpret_cast<int (*)()>(enabled)() != 0;
}

}  // namespace

ReDAGExecutor::Core::Core(const rclcpp::Context::SharedPtr &context, ReDAGOptions options)
    : context_(context),
      options_(prepare(std::move(options))),
      setup_(set_up(options_)),
      origin_(monotonic_now()),
      engine_(make_engine()),
      timer_(*engine_, origin_),
      bridge_(context),
      tasks_(
          redag::Platform{
              .workers = setup_.config.workers, .preemption = setup_.mode.mode, .devices = options_.devices},
          options_.policy, options_.ties, options_.workload ? &*options_.workload : nullptr),
      registry_(context, options_, setup_.config.workers,
                {.engine = *engine_, .timer = timer_, .bridge = bridge_, .tasks = tasks_}) {
  engine_->share_releases(timer_.thread());
  for (std::string &warning : setup_.warnings) notes_.warn(std::move(warning));
  setup_.warnings.clear();
  if (options_.live) go_live();
}

std::unique_ptr<redag::runtime::Engine> ReDAGExecutor::Core::make_engine() {
  redag::runtime::EngineOptions options;
  options.spins = redag::runtime::spins_before_sleep(setup_, options_.spin.count());
  if (options_.lock_memory) options.touched_stack = redag::runtime::kTouchedStack;
  options.config = setup_.config;
  options.config.reuse_ids = options_.trace_capacity == 0;  // in a trace an id stands for one task
  options.band = setup_.band;
  options.order_folder = setup_.order_folder;
  options.cpus = options_.cpus;
  options.spare_threads = options_.spare_threads;
  options.trace_capacity = options_.trace_capacity;
  options.measure = options_.live;
  options.waits_priority = setup_.timer_priority();
  options.start_paused = true;
  options.on_exception = [this](const redag::runtime::Job &job, std::exception_ptr e) { on_exception(job, e); };
  options.devices = options_.devices;
  Workload empty;
  empty.platform.devices = options_.devices;
  auto scheduler = std::make_unique<redag::sched::PriorityScheduler>(empty, options.config);
  auto engine = std::make_unique<redag::runtime::Engine>(std::move(scheduler), std::move(options));
  engine->set_origin(origin_);
  return engine;
}

void ReDAGExecutor::Core::go_live() {
  const std::string name = options_.workload ? options_.workload->name : "";
  auto publisher = redag::live::Publisher::start(
      redag::runtime::live_options(name.empty() ? "ros" : name, "ros", setup_.mode, setup_.config),
      [this](redag::live::Sample &sample) {
        tasks_.sample(*engine_, notes_.live_bounds(), sample);
        sample.alert = alert();
      });
  if (publisher) {
    live_ = *std::move(publisher);
  } else {
    notes_.warn(to_string(publisher.error()));
  }
}

ReDAGExecutor::Core::~Core() = default;

void ReDAGExecutor::Core::open(ExecutorHooks hooks, const std::vector<const rclcpp::GuardCondition *> &conditions) {
  hooks_ = std::move(hooks);
  registry_.open(shared_from_this(), hooks_.groups);
  for (const rclcpp::GuardCondition *condition : conditions) bridge_.watch(*condition);
}

void ReDAGExecutor::Core::close() {
  live_.reset();
  timer_.stop();
  engine_->halt();
  if (watchdog_) (void)engine_->wait_idle(kNever);  // the watchdog still reports a job that delays this
  watchdog_.reset();
  engine_->join();
  registry_.close();
  const redag::LockGuard noted_guard(noted_lock_);
  noted_.clear();
}

// ---- arrivals ----

void ReDAGExecutor::Core::note(std::shared_ptr<Callback> callback) {
  const redag::LockGuard guard(noted_lock_);
  noted_.push_back(std::move(callback));
}

void ReDAGExecutor::Core::wake() {
  // waiting_ is read after note(). A thread that is about to wait then sees what was noted, or waiting_ is seen here.
  // While workers run, redag-wait admits callbacks that were noted just before they began.
  if (waiting_ || direct_) bridge_.wake();
}

void ReDAGExecutor::Core::timers_changed() {
  if (timer_.is_running()) {
    timer_.changed();
  } else if (waiting_) {
    bridge_.wake();
  }
}

void ReDAGExecutor::Core::exchange_arrived() {
  if (!options_.deadlocks || looks_for_deadlocks_.load(std::memory_order_relaxed)) return;
  if (!looks_for_deadlocks_.exchange(true)) keeper_parker_.unpark();
}

void ReDAGExecutor::Core::let_wait() {
  if (lets_wait_.load(std::memory_order_acquire)) return;
  const redag::LockGuard guard(let_wait_lock_);
  if (const redag::Result<void> ready = engine_->let_wait(); !ready) throw std::runtime_error(to_string(ready.error()));
  lets_wait_.store(true, std::memory_order_release);
}

redag::runtime::DeviceHandle ReDAGExecutor::Core::device(const std::string &name) const {
  for (std::size_t d = 0; d < options_.devices.size(); ++d) {
    if (options_.devices[d].name == name) return {*engine_, redag::DeviceId(d)};
  }
  throw std::out_of_range(fmt::format(
      "redag_rclcpp::device(): the executor has no device '{}' (add it to ReDAGOptions::devices, or to the platform of "
      "the workload file)",
      name));
}

void ReDAGExecutor::Core::wait_set_changed() {
  if (waiting_ || direct_) bridge_.wake();
}

void ReDAGExecutor::Core::rate_seen() {
  if (rate_seen_.exchange(true)) return;
  keeper_parker_.unpark();
}

void ReDAGExecutor::Core::entities_changed() {
  if (registry_.set_stale()) return;
  keeper_parker_.unpark();
  if (waiting_) bridge_.wake();
}

void ReDAGExecutor::Core::admit_noted() {
  std::vector<std::shared_ptr<Callback>> noted;
  {
    const redag::LockGuard guard(noted_lock_);
    noted.swap(noted_);
  }
  for (const auto &callback : noted) callback->admit();
}

// For the spin functions that pull: makes ready jobs of everything that there is to do now.
void ReDAGExecutor::Core::admit(bool look_around) {
  begin_learning();
  adopt_rates();
  if (learning_ && engine_->now() >= learn_until_) stop_learning();
  if (registry_.is_stale()) registry_.collect();
  if (look_around && !bridge_.empty()) bridge_.wait(nanoseconds(0));
  (void)timer_.expire();
  admit_noted();
}

// ---- spinning ----

void ReDAGExecutor::Core::start() {
  begin_learning();
  if (started_) return;
  if (!start_error_.empty()) throw std::runtime_error(start_error_);  // an engine can be started only once
  if (options_.lock_memory) {
    if (const redag::Result<void> locked = redag::runtime::lock_memory(); !locked) {
      notes_.warn(to_string(locked.error()));
    }
  }
  // Starts this thread before the engine's threads, which can be started only once. If it fails, a caller who catches
  // the exception may spin again.
  if (const redag::Result<void> timer = timer_.start(setup_.timer_priority()); !timer) {
    throw std::runtime_error(to_string(timer.error()));
  }
  if (const redag::Result<void> ready = engine_->start(); !ready) {
    start_error_ = to_string(ready.error());
    throw std::runtime_error(start_error_);
  }
  started_ = true;
  if (options_.watchdog.count() > 0) watch_jobs();
  RCLCPP_INFO(logger(), "%u workers, preemption %s%s%s", setup_.config.workers, to_string(setup_.mode.mode),
              setup_.mode.reason.empty() ? "" : ", ", setup_.mode.reason.c_str());
  for (const std::string &warning : notes_.warnings()) RCLCPP_WARN(logger(), "%s", warning.c_str());
  if (setup_.mode.mode == redag::PreemptionMode::Os && !locks_inherit()) {
    RCLCPP_INFO(logger(), "the middleware's locks do not inherit priority: preload libredag_pi.so (see docs/ros2.md)");
  }
  if (options_.workload) report_unmatched_at_ = engine_->now() + kNodesAppear;
}

// Logs the tasks of the workload that still have no callback when nodes and components should have been loaded.
void ReDAGExecutor::Core::report_unmatched() {
  report_unmatched_at_ = kNever;
  for (const std::string &line : registry_.unmatched()) RCLCPP_WARN(logger(), "%s", line.c_str());
}

// Logs what was found, if it differs from the last time. Threads can appear late: that there are none is reported only
// when they are `due`.
void ReDAGExecutor::Core::report(const RaisedMiddleware &middleware, bool due) {
  if (middleware.found().threads.empty() && !due) return;
  const rmw_context_t *const rmw = rcl_context_get_rmw_context(context_->get_rcl_context().get());
  const MiddlewareReport report =
      describe(middleware.found(),
               {.rmw = rmw == nullptr || rmw->implementation_identifier == nullptr ? "the middleware"
                                                                                   : rmw->implementation_identifier,
                .wanted = middleware.priority(),
                .top_job = setup_.top_job_priority(),
                .timer = setup_.timer_priority()});
  if (report.summary != middleware_summary_) RCLCPP_INFO(logger(), "%s", report.summary.c_str());
  middleware_summary_ = report.summary;
  for (const std::string &warning : report.warnings) {
    if (notes_.warn(warning)) RCLCPP_WARN(logger(), "%s", warning.c_str());
  }
}

void ReDAGExecutor::Core::watch_jobs() {
  const redag::runtime::WatchdogOptions limits{.limits = {.longest = options_.watchdog.count(), .deadlines = 0}};
  watchdog_ =
      std::make_unique<redag::runtime::Watchdog>(*engine_, limits, [this](const redag::runtime::OverdueJob &overdue) {
        RCLCPP_WARN(logger(), "%s: %s", tasks_.name_of(overdue.job.task).c_str(), describe(overdue).c_str());
      });
  if (const redag::Result<void> started = watchdog_->start({"redag-watch", setup_.timer_priority(), {}}); !started) {
    watchdog_.reset();
    throw std::runtime_error(to_string(started.error()));
  }
}

void ReDAGExecutor::Core::spin() {
  std::optional<RaisedMiddleware> middleware;
  if (setup_.timer_priority() > 0) middleware.emplace(options_.raise_middleware ? setup_.timer_priority() : 0);
  start();
  registry_.collect();
  direct_ = true;
  timer_.resume();
  wait_set_done_ = false;
  wait_set_failure_ = nullptr;
  engine_->resume();
  try {
    redag::Result<std::thread> watcher =
        redag::runtime::start_thread({"redag-wait", setup_.timer_priority(), {}}, [this] { watch_wait_set(); });
    if (!watcher) throw std::runtime_error(to_string(watcher.error()));
    const struct Join {
      ~Join() {
        core.wait_set_done_ = true;
        core.bridge_.wake();
        thread.join();
      }
      Core &core;
      std::thread thread;
    } join{*this, *std::move(watcher)};
    if (middleware) {
      report(*middleware, false);
      look_at_middleware_at_ = engine_->now() + kThreadsAppear;
    }
    keep_house(middleware ? &*middleware : nullptr);
  } catch (...) {
    // One cause is a context that was shut down while entities were collected.
    stop_workers();
    if (rclcpp::ok(context_)) throw;
    notes_.throw_failure();
    return;
  }
  stop_workers();
  if (wait_set_failure_ && rclcpp::ok(context_)) std::rethrow_exception(wait_set_failure_);
  notes_.throw_failure();
}

// Work of spin() on the calling thread, at that thread's own priority: everything that takes long and is not urgent.
void ReDAGExecutor::Core::keep_house(RaisedMiddleware *middleware) {
  while (hooks_.may_spin() && !wait_set_done_) {
    const bool is_stale = registry_.is_stale();
    if (is_stale) registry_.collect();
    const redag::Time now = engine_->now();
    if (middleware != nullptr && now >= look_at_middleware_at_) {
      look_at_middleware_at_ = kNever;
      middleware->look();
      report(*middleware, true);
    }
    // Entities can make the middleware create threads.
    if (middleware != nullptr && is_stale && look_at_middleware_at_ == kNever) {
      look_at_middleware_at_ = now + kThreadsAppear;
    }
    adopt_rates();
    if (learning_ && now >= learn_until_) stop_learning();
    if (now >= report_unmatched_at_) report_unmatched();
    if (looks_for_deadlocks_ && look_for_deadlocks_at_ == kNever) {
      look_for_deadlocks_at_ = now + DeadlockDetector::kInterval;
    }
    if (now >= look_for_deadlocks_at_) look_for_deadlocks();
    const redag::Time next = std::min(
        {report_unmatched_at_, look_at_middleware_at_, look_for_deadlocks_at_, learning_ ? learn_until_ : kNever});
    if (next == kNever) {
      keeper_parker_.park();
    } else if (next > now) {
      keeper_parker_.park_until(origin_ + next);
    }
  }
}

void ReDAGExecutor::Core::look_for_deadlocks() {
  class View final : public DeadlockView {
   public:
    View(const TaskTable &tasks, std::uint32_t workers, const std::vector<Endpoint> &endpoints)
        : tasks_(tasks), workers_(workers), endpoints_(endpoints) {}
    [[nodiscard]] std::uint32_t workers() const override { return workers_; }
    [[nodiscard]] CallbackPlace place_of(redag::TaskId task) const override { return tasks_.place_of(task); }
    [[nodiscard]] std::vector<Endpoint> endpoints() const override { return endpoints_; }
    [[nodiscard]] ThreadWait wait_of(int thread_id) const override { return wait_of_thread(thread_id); }

   private:
    const TaskTable &tasks_;
    const std::uint32_t workers_;
    const std::vector<Endpoint> &endpoints_;
  };
  looks_for_deadlocks_ = false;  // what arrives from here on sets it again
  engine_->started(started_jobs_);
  const std::vector<Endpoint> endpoints = tasks_.endpoints();
  const redag::Time now = engine_->now();
  std::vector<Deadlock> begun;
  std::vector<Deadlock> ended;
  deadlock_detector_.look(now, started_jobs_, View(tasks_, setup_.config.workers, endpoints), begun, ended);
  for (const Deadlock &deadlock : begun) {
    notes_.add(deadlock);
    if (deadlock.certain) {
      RCLCPP_ERROR(logger(), "deadlock: %s", deadlock.text.c_str());
    } else {
      RCLCPP_WARN(logger(), "possible deadlock: %s", deadlock.text.c_str());
    }
  }
  for (const Deadlock &deadlock : ended) {
    notes_.add(deadlock);
    RCLCPP_INFO(logger(), "the deadlock of %s has ended after %s", deadlock.waiting.c_str(),
                redag::humanize_duration(deadlock.ended - deadlock.begun).c_str());
  }
  const bool goes_on =
      deadlock_detector_.has_reported() ||
      std::any_of(endpoints.begin(), endpoints.end(), [](const Endpoint &e) { return !e.kept.empty(); });
  if (goes_on) looks_for_deadlocks_ = true;
  look_for_deadlocks_at_ = goes_on ? now + DeadlockDetector::kInterval : kNever;
}

// Runs on the thread redag-wait, with os above all jobs. While jobs use all processors, cancel() thus still takes
// effect, and arrivals that only the wait set sees are still released.
void ReDAGExecutor::Core::watch_wait_set() noexcept {
  try {
    while (hooks_.may_spin() && !wait_set_done_) {
      admit_noted();
      bridge_.wait(nanoseconds(-1));
    }
  } catch (...) {
    // One cause is a context that was shut down while the wait set was filled.
    wait_set_failure_ = std::current_exception();
  }
  timer_.pause();
  engine_->pause();
  wait_set_done_ = true;
  keeper_parker_.unpark();
}

void ReDAGExecutor::Core::stop_workers() {
  timer_.pause();
  engine_->pause();
  engine_->end_started();
  direct_ = false;
  if (look_for_deadlocks_at_ != kNever) look_for_deadlocks();  // those of the jobs that have ended are over
}

void ReDAGExecutor::Core::spin_ready(nanoseconds max_duration, bool exhaustive) {
  const redag::Time end = max_duration.count() == 0 ? kNever : saturated_add(engine_->now(), max_duration.count());
  bool first = true;  // it runs also if the time is over: collecting entities can take longer
  bool again = true;
  while (again) {
    admit(true);
    again = false;
    while (hooks_.may_spin() && (first || engine_->now() < end) && run_one()) {
      first = false;
      again = exhaustive;
    }
  }
}

void ReDAGExecutor::Core::spin_one(nanoseconds timeout) {
  const redag::Time end = timeout.count() < 0 ? kNever : saturated_add(engine_->now(), timeout.count());
  admit(true);
  while (hooks_.may_spin() && !run_one()) {
    const redag::Time now = engine_->now();
    if (now >= end) return;
    waiting_ = true;
    bool idle = !registry_.is_stale();
    {
      const redag::LockGuard guard(noted_lock_);
      idle = idle && noted_.empty();
    }
    const redag::Time next = std::min({end, timer_.queue().next(), learning_ ? learn_until_ : kNever});
    if (idle) bridge_.wait(next == kNever ? nanoseconds(-1) : nanoseconds(std::max<redag::Duration>(0, next - now)));
    waiting_ = false;
    admit(false);
  }
}

bool ReDAGExecutor::Core::run_one() {
  const bool ran = engine_->run_one();
  notes_.throw_failure();
  return ran;
}

void ReDAGExecutor::Core::on_exception(const redag::runtime::Job &job, std::exception_ptr exception) {
  if (options_.on_exception) {
    if (options_.on_exception(ExceptionInfo{tasks_.name_of(job.task), exception}) == OnException::Continue) return;
  }
  notes_.fail(std::move(exception));
  hooks_.stop();
}

// ---- learning ----

void ReDAGExecutor::Core::begin_learning() {
  if (options_.learn.count() <= 0 || learn_until_ != kNever) return;
  learn_until_ = saturated_add(engine_->now(), options_.learn.count());
  learns_ = true;
  learning_ = true;
}

void ReDAGExecutor::Core::stop_learning() {
  learning_ = false;
  RCLCPP_INFO(logger(), "learned the rates of %zu callbacks", registry_.adopt_rates());
  learned_ = true;
}

void ReDAGExecutor::Core::adopt_rates() {
  if (rate_seen_.exchange(false)) static_cast<void>(registry_.adopt_rates());
}

// ---- queries ----

std::vector<std::string> ReDAGExecutor::Core::warnings() const {
  std::vector<std::string> all = notes_.warnings();
  for (std::string &line : registry_.unmatched()) all.push_back(std::move(line));
  for (redag::runtime::Problem &problem : engine_->problems()) all.push_back(std::move(problem.text));
  return all;
}

// The deadlocks that last, in one line.
std::string ReDAGExecutor::Core::alert() const {
  std::vector<Deadlock> lasting = notes_.deadlocks();
  std::erase_if(lasting, [](const Deadlock &deadlock) { return deadlock.ended != kNever; });
  if (lasting.empty()) return redag::runtime::alert_of(*engine_);
  const Deadlock &first = lasting.front();
  std::string text =
      fmt::format("{}: {} waits for {}, which cannot get {}", first.certain ? "deadlock" : "possible deadlock",
                  first.waiting, first.blocked, first.resource);
  if (lasting.size() > 1) text = fmt::format("{} deadlocks; {}", lasting.size(), text);
  return text;
}

redag::trace::RunInfo ReDAGExecutor::Core::run_info(std::vector<std::uint32_t> &positions) const {
  redag::trace::RunInfo info;
  info.workload = tasks_.describe(positions);
  info.executor = "redag";
  info.config = engine_->options().config;
  info.preemption = to_string(setup_.mode.mode);
  info.preemption_why = setup_.mode.reason;
  info.driver = redag::trace::Driver::Ros;
  info.stepped = true;  // between spins no job starts, and some spin functions run one job at a time
  info.end = engine_->now();
  info.settled = engine_->settled();
  info.origin = origin_;
  info.lost_events = engine_->lost_events();
  info.machine = redag::trace::this_machine();
  info.provenance = redag::current_provenance();
  for (const Deadlock &deadlock : notes_.deadlocks()) {
    info.remarks.push_back({.begun = deadlock.begun,
                            .ended = deadlock.ended,
                            .text = (deadlock.certain ? "deadlock: " : "possible deadlock: ") + deadlock.text});
  }
  return info;
}

}  // namespace redag_rclcpp
