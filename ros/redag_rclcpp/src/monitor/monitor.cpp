// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/monitor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "bounds.hpp"
#include "compat.hpp"
#include "live_page.hpp"
#include "rclcpp/exceptions.hpp"
#include "rclcpp/logging.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/trace/output_file.hpp"
#include "report.hpp"
#include "results.hpp"
#include "std_msgs/msg/string.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp {

using diagnostic_msgs::msg::DiagnosticArray;
using redag::JobEvent;
using std_msgs::msg::String;
using std_srvs::srv::Trigger;

namespace {

constexpr auto kDrainPeriod = std::chrono::milliseconds(50);
constexpr std::size_t kMostPublished = 200;  // callbacks, of a few hundred bytes each; on request there are all
constexpr auto kLookPeriod = std::chrono::milliseconds(500);  // between looks at the callbacks behind the bounds

/// Schedule of a repeated action.
class Turn {
 public:
  using Clock = std::chrono::steady_clock;

  /// `period` 0 means never.
  explicit Turn(std::chrono::nanoseconds period) : period_(period) {
    if (period.count() == 0) next_ = Clock::time_point::max();
  }

  [[nodiscard]] Clock::time_point next() const { return next_; }
  [[nodiscard]] bool is_due(Clock::time_point now) {
    if (now < next_) return false;
    next_ = now + period_;
    return true;
  }

 private:
  std::chrono::nanoseconds period_;
  Clock::time_point next_ = Clock::now();
};

}  // namespace

class Monitor::Impl : public std::enable_shared_from_this<Impl> {
 public:
  Impl(rclcpp::Node::SharedPtr node, ReDAGExecutor &executor, MonitorOptions options)
      : node_(std::move(node)),
        executor_(executor),
        options_(std::move(options)),
        has_bounds_(options_.workload.has_value()),
        keeper_(options_.trace_events) {
    if (has_bounds_) bounds_.emplace(*options_.workload, options_.calibration);
    config_ = executor_.as_trace({}).info.config;
    if (options_.trace.empty()) return;
    const redag::Result<void> ready = prepare_folder(options_.trace);
    if (!ready) throw std::runtime_error(to_string(ready.error()));
    if (const auto aside = record_.prepare(options_.trace)) {
      RCLCPP_WARN(node_->get_logger(),
                  "an earlier process was killed: its trace is now '%s', which 'redag why' and 'redag report' read",
                  aside->c_str());
    }
  }

  void start();
  void stop_thread();

  [[nodiscard]] Snapshot snapshot();
  [[nodiscard]] redag::Result<std::string> save(const std::string &path) const;
  redag::Result<void> finish();

 private:
  void create_entities();
  void publish();
  void main();
  void drain();
  void look_at_callbacks();

  const rclcpp::Node::SharedPtr node_;
  ReDAGExecutor &executor_;
  const MonitorOptions options_;
  redag::sched::Config config_;

  rclcpp::CallbackGroup::SharedPtr group_;
  rclcpp::Publisher<DiagnosticArray>::SharedPtr diagnostics_;
  rclcpp::Publisher<String>::SharedPtr metrics_;
  rclcpp::Service<Trigger>::SharedPtr metrics_service_;
  rclcpp::Service<Trigger>::SharedPtr save_service_;

  const bool has_bounds_;
  redag::Mutex bounds_lock_;
  std::optional<Bounds> bounds_ REDAG_GUARDED_BY(bounds_lock_);  // set if has_bounds_

  // Used by the monitor's thread, and by finish() once that thread has ended.
  std::unique_ptr<LivePage> live_;
  Diagnoser diagnoser_;
  TraceKeeper keeper_;
  RunRecord record_;
  std::vector<JobEvent> events_;

  std::thread thread_;
  redag::Mutex stop_lock_;
  std::condition_variable_any stop_condition_;
  bool stop_ REDAG_GUARDED_BY(stop_lock_) = false;
  bool finished_ REDAG_GUARDED_BY(stop_lock_) = false;
};

void Monitor::Impl::start() {
  create_entities();
  RCLCPP_INFO(node_->get_logger(), "a callback without a stated period has the priority of one of %s%s",
              redag::humanize_duration(options_.default_period.count()).c_str(),
              executor_.learning_done() ? "" : ", until its rate is learned");
  if (options_.live) live_ = std::make_unique<LivePage>(executor_);
  RCLCPP_INFO(node_->get_logger(), "%s%s and %s report the misses of callbacks",
              live_ && live_->exists() ? "'redag top' shows the callbacks while they run, " : "",
              diagnostics_->get_topic_name(), metrics_->get_topic_name());
  if (has_bounds_ || !options_.trace.empty() || options_.period.count() > 0) thread_ = std::thread([this] { main(); });
}

void Monitor::Impl::create_entities() {
  const auto weak = weak_from_this();
  group_ = node_->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  rclcpp::PublisherOptions options;
  options.use_intra_process_comm = rclcpp::IntraProcessSetting::Disable;  // Humble refuses latched topics with it
  diagnostics_ = node_->create_publisher<DiagnosticArray>("/diagnostics", 10, options);
  metrics_ = node_->create_publisher<String>("~/metrics", rclcpp::QoS(1).transient_local(), options);

  const auto create_service = [&](const char *name, auto callback) {
    return node_->create_service<Trigger>(name, callback, compat::services_qos(), group_);
  };
  metrics_service_ =
      create_service("~/metrics", [weak](Trigger::Request::ConstSharedPtr, Trigger::Response::SharedPtr response) {
        const auto self = weak.lock();
        if (!self) return;
        response->success = true;
        response->message = to_json(self->snapshot());
      });
  if (!node_->has_parameter("save_path")) node_->declare_parameter<std::string>("save_path", options_.save_path);
  save_service_ =
      create_service("~/save", [weak](Trigger::Request::ConstSharedPtr, Trigger::Response::SharedPtr response) {
        const auto self = weak.lock();
        if (!self) return;
        const redag::Result<std::string> saved = self->save(self->node_->get_parameter("save_path").value_to_string());
        response->success = saved.has_value();
        response->message = saved ? "wrote " + *saved : to_string(saved.error());
      });
}

Snapshot Monitor::Impl::snapshot() {
  Snapshot result;
  result.stamp = node_->now().nanoseconds();
  result.mode = executor_.mode();
  result.workers = executor_.workers();
  result.policy = config_.policy;
  result.learning = !executor_.learning_done();
  result.warnings = executor_.warnings();
  result.errors = executor_.errors();
  result.deadlocks = executor_.deadlocks();
  const std::vector<CallbackStats> stats = executor_.stats();
  const redag::LockGuard guard(bounds_lock_);
  result.has_bounds = has_bounds_;
  if (bounds_) {
    result.bounds_absent = bounds_->absent();
    result.machine = bounds_->machine();
  }
  for (const CallbackStats &callback : stats) {
    TaskFigures task;
    task.stats = callback;
    const auto kind = callback.id.kind;
    const bool learned = kind == redag::Callback::Kind::Subscription && !is_ros_internal(callback.id) &&
                         !result.learning && callback.period != options_.default_period.count();
    task.has_deadline = !callback.dag.empty() || kind == redag::Callback::Kind::Timer || learned;
    if (bounds_) {
      const auto bound = bounds_->tasks().find(callback.task);
      if (bound != bounds_->tasks().end() && !callback.dag.empty()) task.bound = bound->second;
    }
    result.tasks.push_back(std::move(task));
  }
  return result;
}

redag::Result<std::string> Monitor::Impl::save(const std::string &path) const {
  if (path.empty()) return redag::make_error("parameter 'save_path' is empty", "set it to the path of a file");
  const std::string absolute = std::filesystem::absolute(path).lexically_normal().string();
  std::set<std::string> configured;
  for (const CallbackStats &callback : executor_.stats(false)) configured.insert(callback.dag);
  redag::Workload learned = executor_.learned();
  drop_idle_tasks(learned, configured);
  if (learned.dags.empty()) return redag::make_error("no callback has run yet");
  const redag::Result<void> saved =
      redag::save_workload(learned, absolute, redag::ValidateOptions{.wcet_optional = true, .waits = true});
  if (!saved) return tl::unexpected<redag::Diagnostics>(saved.error());
  return absolute;
}

// ---- the monitor's thread ----

void Monitor::Impl::main() {
  const bool has_events = has_bounds_ || !options_.trace.empty();
  Turn look(has_bounds_ ? kLookPeriod : std::chrono::nanoseconds(0));
  Turn draining(has_events ? kDrainPeriod : std::chrono::nanoseconds(0));
  Turn publishing(options_.period);
  for (;;) {
    const auto now = Turn::Clock::now();
    if (look.is_due(now)) look_at_callbacks();
    if (draining.is_due(now)) drain();
    if (publishing.is_due(now)) publish();
    const auto next = std::min({look.next(), draining.next(), publishing.next()});
    const redag::LockGuard guard(stop_lock_);
    while (!stop_ && stop_condition_.wait_until(stop_lock_, next) == std::cv_status::no_timeout) {
    }
    if (stop_) return;
  }
}

// Publishes on the monitor's own thread: a callback for this would have to wait for an overloaded executor.
void Monitor::Impl::publish() {
  Snapshot now = snapshot();
  show_most(now, kMostPublished);
  DiagnosticArray array;
  array.header.stamp = node_->now();
  array.status = diagnoser_.diagnose(now);
  String message;
  message.data = to_json(now);
  try {
    diagnostics_->publish(array);
    metrics_->publish(message);
  } catch (const rclcpp::exceptions::RCLError &error) {
    if (rclcpp::ok(node_->get_node_base_interface()->get_context())) {
      RCLCPP_ERROR(node_->get_logger(), "cannot publish metrics: %s", error.what());
    }
  }
}

void Monitor::Impl::look_at_callbacks() {
  if (!has_bounds_) return;
  const std::vector<CallbackStats> stats = executor_.stats(false);
  std::string absent;
  {
    // The analysis works on a copy: requests for figures do not wait for it.
    std::optional<Bounds> updated;
    {
      const redag::LockGuard guard(bounds_lock_);
      updated = bounds_;
    }
    if (!updated->update(stats, config_, [this] { return executor_.learned(); })) return;
    absent = updated->absent();
    std::map<std::string, redag::Duration> shown;
    for (const auto &[name, bound] : updated->tasks()) shown[name] = bound.response;
    if (live_) live_->set_bounds(std::move(shown));
    const redag::LockGuard guard(bounds_lock_);
    bounds_ = std::move(updated);
  }
  if (!absent.empty()) RCLCPP_INFO(node_->get_logger(), "bounds on response times are missing: %s", absent.c_str());
}

void Monitor::Impl::drain() {
  events_.clear();
  executor_.drain_trace(events_);
  if (!options_.trace.empty()) {
    if (const redag::Result<void> recorded = record_.add(events_, executor_); !recorded) {
      RCLCPP_WARN(node_->get_logger(), "if this process is killed, its trace is lost: %s",
                  to_string(recorded.error()).c_str());
    }
    const bool was_cut = keeper_.is_cut();
    keeper_.add(events_);
    if (keeper_.is_cut() && !was_cut) {
      RCLCPP_WARN(node_->get_logger(),
                  "the trace ends here, after %zu events: raise the parameter 'trace_events' for a longer one",
                  keeper_.size());
    }
  }
  if (!has_bounds_ || events_.empty()) return;
  std::vector<std::pair<std::string, TaskBound>> exceeded;  // logged without the lock, which callbacks want
  {
    const redag::LockGuard guard(bounds_lock_);
    bounds_->count(
        events_, [this](redag::TaskId task) { return executor_.task_name(task); },
        [&](const std::string &name, const TaskBound &bound) { exceeded.emplace_back(name, bound); });
  }
  for (const auto &[name, bound] : exceeded) {
    RCLCPP_WARN(node_->get_logger(),
                "the response time of %s was %s, which exceeds its bound of %s (%s): an execution time or a rate "
                "differs from the workload, or a callback ran that the workload does not contain",
                name.c_str(), redag::humanize_duration(bound.worst).c_str(),
                redag::format_duration(bound.response).c_str(), bound.method.c_str());
  }
}

void Monitor::Impl::stop_thread() {
  {
    const redag::LockGuard guard(stop_lock_);
    stop_ = true;
  }
  stop_condition_.notify_all();
  if (thread_.joinable()) thread_.join();
}

redag::Result<void> Monitor::Impl::finish() {
  stop_thread();
  {
    const redag::LockGuard guard(stop_lock_);
    if (std::exchange(finished_, true)) return {};
  }
  live_.reset();
  const bool has_trace = !options_.trace.empty();
  if (has_bounds_ || has_trace) drain();
  const Snapshot last = snapshot();
  for (const std::string &line : closing_lines(last)) RCLCPP_INFO(node_->get_logger(), "%s", line.c_str());

  redag::Diagnostics problems;
  if (has_trace) {
    auto file = redag::trace::OutputFile::create(options_.trace + "/metrics.json");
    redag::Result<void> written;
    if (file) {
      file->write(to_json(last) + "\n");
      written = file->commit();
    } else {
      written = tl::unexpected<redag::Diagnostics>(file.error());
    }
    if (!written) problems = written.error();
    const redag::Diagnostics more = keeper_.write({.folder = options_.trace}, executor_);
    problems.insert(problems.end(), more.begin(), more.end());
    if (problems.empty()) {
      RCLCPP_INFO(node_->get_logger(), "wrote %s: metrics.json, %s ('redag report %s' makes a page of them)",
                  options_.trace.c_str(), keeper_.names().c_str(), options_.trace.c_str());
    }
  }
  if (!problems.empty()) return tl::unexpected<redag::Diagnostics>(std::move(problems));
  return {};
}

Monitor::Monitor(const rclcpp::Node::SharedPtr &node, ReDAGExecutor &executor, MonitorOptions options)
    : impl_(std::make_shared<Impl>(node, executor, std::move(options))) {
  impl_->start();
}

Monitor::~Monitor() {
  const redag::Result<void> done = impl_->finish();
  if (!done) RCLCPP_ERROR(rclcpp::get_logger("redag_rclcpp"), "%s", to_string(done.error()).c_str());
}

std::string Monitor::metrics() const { return to_json(impl_->snapshot()); }
redag::Result<std::string> Monitor::save(const std::string &path) const { return impl_->save(path); }
redag::Result<void> Monitor::finish() { return impl_->finish(); }

}  // namespace redag_rclcpp
