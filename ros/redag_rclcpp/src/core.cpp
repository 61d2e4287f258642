// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "core.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>

#include "engine_setup.hpp"
#include "rclcpp/logging.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"

namespace redag_rclcpp {

using redag::kNever;
using redag::saturated_add;
using redag::runtime::monotonic_now;
using std::chrono::nanoseconds;

namespace {

constexpr redag::Duration kNodesAppear = 3 * redag::kSecond;  // after the first start: until names should match

rclcpp::Logger logger() { return rclcpp::get_logger("redag_rclcpp"); }

/// True if libredag_pi.so is in the process and switched on.
bool locks_inherit() {
  void *const enabled = dlsym(RTLD_DEFAULT, "redag_pi_enabled");
  return enabled != nullptr && reinterpret_cast<int (*)()>(enabled)() != 0;
}

}  // namespace

ReDAGExecutor::Core::Core(const rclcpp::Context::SharedPtr &context, ReDAGOptions options)
    : context_(context),
      options_(checked(std::move(options))),
      setup_(set_up(options_)),
      origin_(monotonic_now()),
      engine_(make_engine(options_, setup_, origin_,
                          [this](const redag::runtime::Job &job, std::exception_ptr e) { on_exception(job, e); })),
      timer_(*engine_, origin_),
      bridge_(context),
      tasks_(
          redag::Platform{
              .workers = setup_.config.workers, .preemption = setup_.mode.mode, .devices = devices_of(options_)},
          setup_.config.policy, setup_.config.ties, options_.workload ? &**options_.workload : nullptr,
          options_.trace_capacity > 0),
      registry_(context, options_, setup_.config.workers,
                {.engine = *engine_, .timer = timer_, .bridge = bridge_, .tasks = tasks_, .notes = notes_}),
      learning_(registry_, options_.learn.count()),
      deadlock_watch_({.engine = *engine_, .tasks = tasks_, .notes = notes_}, setup_.config.workers) {
  engine_->share_releases(timer_.thread());
  for (std::string &warning : setup_.warnings) notes_.warn(std::move(warning));
  setup_.warnings.clear();
}

ReDAGExecutor::Core::~Core() = default;

void ReDAGExecutor::Core::open(ExecutorHooks hooks, const std::vector<const rclcpp::GuardCondition *> &conditions) {
  hooks_ = std::move(hooks);
  registry_.open(shared_from_this(), hooks_.groups);
  for (const rclcpp::GuardCondition *condition : conditions) bridge_.watch(*condition);
  shutdown_ = context_->add_on_shutdown_callback([weak = weak_from_this()] {
    if (const auto core = weak.lock()) core->start_no_more();
  });
}

void ReDAGExecutor::Core::close() {
  (void)context_->remove_on_shutdown_callback(shutdown_);
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
  if (deadlock_watch_.arrived()) keeper_parker_.unpark();
}

void ReDAGExecutor::Core::let_wait() {
  if (lets_wait_.load(std::memory_order_acquire)) return;
  const redag::LockGuard guard(let_wait_lock_);
  if (const redag::Result<void> ready = engine_->let_wait(); !ready) throw std::runtime_error(to_string(ready.error()));
  lets_wait_.store(true, std::memory_order_release);
}

redag::runtime::DeviceHandle ReDAGExecutor::Core::device(const std::string &name) const {
  const std::vector<redag::Device> &devices = devices_of(options_);
  for (std::size_t d = 0; d < devices.size(); ++d) {
    if (devices[d].name == name) return {*engine_, redag::DeviceId(d)};
  }
  throw std::out_of_range(fmt::format(
      "redag_rclcpp::device(): the executor has no device '{}' (add it to the platform of the workload file)", name));
}

void ReDAGExecutor::Core::wait_set_changed() {
  if (waiting_ || direct_) bridge_.wake();
}

void ReDAGExecutor::Core::look_for_leftovers(const std::shared_ptr<Callback> &callback) {
  try {
    find_leftovers(context_, {callback});
  } catch (const rclcpp::exceptions::RCLError &) {
    // The context was shut down.
  }
}

void ReDAGExecutor::Core::rate_seen() {
  if (learning_.rate_seen()) keeper_parker_.unpark();
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
  learning_.begin(engine_->now());
  learning_.look(engine_->now());
  if (registry_.is_stale()) registry_.collect();
  if (look_around && !bridge_.empty()) bridge_.wait(nanoseconds(0));
  bridge_.destroy_dropped();
  (void)timer_.expire();
  admit_noted();
}

// ---- spinning ----

void ReDAGExecutor::Core::start() {
  learning_.begin(engine_->now());
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
  std::optional<MiddlewareWatch> middleware;
  if (setup_.timer_priority() > 0) {
    middleware.emplace(
        MiddlewareWatch::Parts{.context = *context_, .setup = setup_, .notes = notes_, .summary = middleware_summary_},
        options_.raise_middleware);
  }
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
    if (middleware) middleware->begun(engine_->now());
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
void ReDAGExecutor::Core::keep_house(MiddlewareWatch *middleware) {
  while (hooks_.may_spin() && !wait_set_done_) {
    const bool is_stale = registry_.is_stale();
    if (is_stale) registry_.collect();
    bridge_.destroy_dropped();
    const redag::Time now = engine_->now();
    if (middleware != nullptr) middleware->look(now, is_stale);
    learning_.look(now);
    if (now >= report_unmatched_at_) report_unmatched();
    deadlock_watch_.look();
    const redag::Time next =
        std::min({registry_.look_at_edges(now), report_unmatched_at_, deadlock_watch_.next_look(),
                  learning_.next_look(), middleware == nullptr ? kNever : middleware->next_look()});
    if (next == kNever) {
      keeper_parker_.park();
    } else if (next > now) {
      keeper_parker_.park_until(origin_ + next);
    }
  }
}

// Runs on the thread redag-wait, with os above all jobs. While jobs use all processors, cancel() thus still takes
// effect, and arrivals that only the wait set sees are still released.
void ReDAGExecutor::Core::watch_wait_set() noexcept {
  try {
    while (hooks_.may_spin() && !wait_set_done_) {
      admit_noted();
      bridge_.wait(nanoseconds(-1));
      if (bridge_.has_dropped()) keeper_parker_.unpark();
    }
  } catch (...) {
    // One cause is a context that was shut down while the wait set was filled.
    wait_set_failure_ = std::current_exception();
  }
  start_no_more();
  wait_set_done_ = true;
  keeper_parker_.unpark();
}

void ReDAGExecutor::Core::start_no_more() {
  timer_.pause();
  engine_->pause();
}

void ReDAGExecutor::Core::stop_workers() {
  start_no_more();
  engine_->end_started();
  direct_ = false;
  deadlock_watch_.jobs_ended();
  bridge_.destroy_dropped();
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
    const redag::Time next = std::min({end, timer_.queue().next(), learning_.next_look()});
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

// ---- queries ----

std::vector<std::string> ReDAGExecutor::Core::warnings() const {
  std::vector<std::string> all = notes_.warnings();
  for (std::string &line : registry_.unmatched()) all.push_back(std::move(line));
  for (redag::runtime::Problem &problem : engine_->problems()) all.push_back(std::move(problem.text));
  return all;
}

std::vector<std::string> ReDAGExecutor::Core::errors() const {
  std::vector<std::string> errors;
  if (setup_.mode.mode != redag::PreemptionMode::Os) return errors;
  if (!setup_.missing_processors.empty()) errors.push_back(setup_.missing_processors);
  for (redag::runtime::Problem &problem : engine_->problems()) {
    if (problem.breaks_order) errors.push_back(std::move(problem.text));
  }
  return errors;
}

redag::trace::RunInfo ReDAGExecutor::Core::run_info(std::vector<std::uint32_t> &positions) const {
  redag::trace::RunInfo info;
  info.workload = tasks_.describe(positions);
  info.edges = tasks_.edges();
  for (redag::trace::Edge &edge : info.edges) {
    edge.from = redag::TaskId(positions[edge.from.value]);
    edge.to = redag::TaskId(positions[edge.to.value]);
  }
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
  for (const Deadlock &deadlock : notes_.deadlocks()) {
    info.remarks.push_back({.begun = deadlock.begun,
                            .ended = deadlock.ended,
                            .text = (deadlock.certain ? "deadlock: " : "possible deadlock: ") + deadlock.text});
  }
  return info;
}

}  // namespace redag_rclcpp
