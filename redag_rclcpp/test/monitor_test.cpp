// The monitor with a real executor, and its parts in virtual time: what is reported, when, and what is written.
#include "redag_rclcpp/monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rcutils/logging.h>
#include <time.h>

#include <atomic>
#include <cstdarg>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "bounds.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/metrics/trace_checker.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/trace/events_file.hpp"
#include "report.hpp"
#include "spinning.hpp"
#include "std_msgs/msg/string.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using diagnostic_msgs::msg::DiagnosticArray;
using diagnostic_msgs::msg::DiagnosticStatus;
using redag::JobEvent;
using redag::JobEventKind;
using redag::kMillisecond;
using redag::TaskId;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using Json = nlohmann::json;

redag::Workload parse(const std::string &text) {
  auto workload = redag::parse_workload(text, "test.yaml", redag::LoadOptions{.wcet_optional = true});
  EXPECT_TRUE(workload) << to_string(workload.error());
  return workload->workload;
}

constexpr const char *kOneTimer = R"(
name: test
dags:
  - {name: control, tasks: [{name: loop, wcet: 2ms, callback: {node: /robot, timer: 10ms}}]}
)";

constexpr const char *kTwoTimers = R"(
name: test
dags:
  - name: control
    tasks:
      - {name: fast, wcet: 1ms, callback: {node: /robot, timer: {period: 10ms, index: 0}}}
      - {name: slow, wcet: 2ms, callback: {node: /robot, timer: {period: 20ms, index: 1}}}
)";

// ---- bounds ----

CallbackStats stats_of(const std::string &task, redag::Duration period, std::uint32_t index = 0) {
  CallbackStats stats;
  stats.id.node = "/robot";
  stats.id.period = period;
  stats.id.index = index;
  stats.dag = "control";
  stats.task = task;
  stats.period = stats.deadline = period;
  return stats;
}

redag::sched::Config one_worker() {
  redag::sched::Config config;
  config.workers = 1;
  config.preemption = redag::sched::Preemption::None;
  return config;
}

JobEvent event(JobEventKind kind, std::uint32_t task, std::uint32_t job, redag::Time value) {
  JobEvent event;
  event.kind = kind;
  event.task = TaskId(task);
  event.job = job;
  event.time = event.value = value;
  return event;
}

TEST(Bounds, AreThoseOfTheModeThatRuns) {
  const redag::Workload workload = parse(kTwoTimers);
  const std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0),
                                         stats_of("control.slow", 20 * kMillisecond, 1)};
  const auto learned = [&] { return workload; };
  Bounds none(workload);
  EXPECT_TRUE(none.update(stats, one_worker(), learned));
  EXPECT_EQ(none.absent(), "");
  // One worker: the fast one can wait for a slow one that began just before, the slow one for the fast one.
  EXPECT_EQ(none.tasks().at("control.fast").response, 3 * kMillisecond - 1);
  EXPECT_EQ(none.tasks().at("control.slow").response, 3 * kMillisecond);

  redag::sched::Config full = one_worker();
  full.preemption = redag::sched::Preemption::Full;
  Bounds preemptive(workload);
  EXPECT_TRUE(preemptive.update(stats, full, learned));
  EXPECT_EQ(preemptive.tasks().at("control.fast").response, 1 * kMillisecond);
  EXPECT_EQ(preemptive.tasks().at("control.slow").response, 3 * kMillisecond);
}

TEST(Bounds, TheGroupsAreThoseOfRos) {
  const redag::Workload workload = parse(kTwoTimers);
  const std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0),
                                         stats_of("control.slow", 20 * kMillisecond, 1)};
  redag::Workload grouped = workload;
  for (redag::Task &task : grouped.dags[0].tasks) task.group = "g0";
  redag::sched::Config full = one_worker();
  full.preemption = redag::sched::Preemption::Full;
  Bounds bounds(workload);
  EXPECT_TRUE(bounds.update(stats, full, [&] { return grouped; }));
  ASSERT_EQ(bounds.tasks().count("control.fast"), 1U) << bounds.absent();
  EXPECT_EQ(bounds.tasks().at("control.fast").response, 3 * kMillisecond - 1) << "it can find the group taken";
}

TEST(Bounds, AreAnalysedAnewOnlyForOtherCallbacks) {
  const redag::Workload workload = parse(kTwoTimers);
  int asked = 0;
  const auto learned = [&] { return ++asked, workload; };
  std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0)};
  Bounds bounds(workload);
  EXPECT_FALSE(bounds.update({}, one_worker(), learned));
  EXPECT_TRUE(bounds.update(stats, one_worker(), learned));
  EXPECT_FALSE(bounds.update(stats, one_worker(), learned));
  stats.push_back(stats_of("control.slow", 20 * kMillisecond, 1));
  EXPECT_TRUE(bounds.update(stats, one_worker(), learned));
  EXPECT_EQ(asked, 2);
}

TEST(Bounds, SayWhyThereAreNone) {
  std::string text = kOneTimer;
  text.replace(text.find("wcet: 2ms, "), 11, "");
  Bounds open(parse(text));
  const auto nothing = [] { return redag::Workload(); };
  open.update({stats_of("control.loop", 10 * kMillisecond)}, one_worker(), nothing);
  EXPECT_THAT(open.tasks(), IsEmpty());
  EXPECT_EQ(open.absent(), "control.loop has no wcet");

  text = kOneTimer;
  text.replace(text.find("timer: 10ms"), 11, "timer: any}, period: 10ms");
  text.replace(text.find("10ms}}"), 6, "10ms}");
  Bounds any(parse(text));
  any.update({stats_of("control.loop", 10 * kMillisecond, 0), stats_of("control.loop", 10 * kMillisecond, 1)},
             one_worker(), nothing);
  EXPECT_THAT(any.absent(), HasSubstr("control.loop is 2 callbacks"));
  any.update({stats_of("control.loop", 5 * kMillisecond)}, one_worker(), nothing);
  EXPECT_THAT(any.absent(), AllOf(HasSubstr("control.loop"), HasSubstr("5ms"), HasSubstr("10ms")));
}

TEST(Bounds, ResponsesAboveThemAreCountedAndTheFirstIsTold) {
  const redag::Workload workload = parse(kOneTimer);
  Bounds bounds(workload);
  bounds.update({stats_of("control.loop", 10 * kMillisecond)}, one_worker(), [&] { return workload; });
  ASSERT_EQ(bounds.tasks().at("control.loop").response, 2 * kMillisecond);

  std::vector<std::string> told;
  int asked = 0;
  const auto name_of = [&](TaskId task) {
    ++asked;
    return std::string(task.value == 5 ? "control.loop" : "ros.other");
  };
  const auto first = [&](const std::string &name, const TaskBound &bound) {
    told.push_back(name + " " + redag::format_duration(bound.worst));
  };
  using Kind = JobEventKind;
  const redag::Time ms = kMillisecond;
  // Another task's; at the bound; above it, over two calls; skipped and aborted; above it again.
  bounds.count(
      std::vector{event(Kind::Released, 9, 0, 0), event(Kind::Finished, 9, 0, 50 * ms), event(Kind::Released, 5, 0, 0),
                  event(Kind::Finished, 5, 0, 2 * ms), event(Kind::Released, 5, 1, 10 * ms)},
      name_of, first);
  EXPECT_THAT(told, IsEmpty());
  bounds.count(std::vector{event(Kind::Finished, 5, 1, 13 * ms), event(Kind::Released, 5, 2, 20 * ms),
                           event(Kind::Skipped, 5, 2, 0), event(Kind::Released, 5, 3, 30 * ms),
                           event(Kind::Aborted, 5, 3, 39 * ms), event(Kind::Released, 5, 4, 40 * ms),
                           event(Kind::Finished, 5, 4, 45 * ms)},
               name_of, first);
  EXPECT_THAT(told, ElementsAre("control.loop 3ms"));
  EXPECT_EQ(bounds.tasks().at("control.loop").exceeded, 2U);
  EXPECT_EQ(bounds.tasks().at("control.loop").worst, 5 * ms);
  EXPECT_EQ(asked, 4) << "once a task, and for each response above its bound";
}

// ---- diagnostics ----

const DiagnosticStatus *find_status(const std::vector<DiagnosticStatus> &statuses, const std::string &name) {
  for (const DiagnosticStatus &status : statuses) {
    if (status.name == name) return &status;
  }
  return nullptr;
}

std::string value_of(const DiagnosticStatus &status, const std::string &key) {
  for (const auto &pair : status.values) {
    if (pair.key == key) return pair.value;
  }
  return "(none)";
}

Snapshot snapshot_of(std::vector<TaskFigures> tasks) {
  Snapshot snapshot;
  snapshot.workers = 2;
  snapshot.mode.mode = redag::PreemptionMode::Cooperative;
  snapshot.tasks = std::move(tasks);
  return snapshot;
}

TEST(Diagnoser, MissesAreNewOnce) {
  TaskFigures task;
  task.stats = stats_of("control.loop", 10 * kMillisecond);
  task.has_deadline = true;
  Diagnoser diagnoser;
  const auto level_with = [&](std::uint64_t misses) {
    task.stats.misses = misses;
    const auto statuses = diagnoser.diagnose(snapshot_of({task}));
    return find_status(statuses, "ReDAG: DAG control")->level;
  };
  EXPECT_EQ(level_with(0), DiagnosticStatus::OK);
  EXPECT_EQ(level_with(3), DiagnosticStatus::WARN);
  EXPECT_EQ(level_with(3), DiagnosticStatus::OK);
  EXPECT_EQ(level_with(4), DiagnosticStatus::WARN);
  EXPECT_EQ(level_with(0), DiagnosticStatus::OK) << "the node was loaded again";
  EXPECT_EQ(level_with(1), DiagnosticStatus::WARN);

  task.has_deadline = false;
  EXPECT_EQ(level_with(7), DiagnosticStatus::OK) << "nobody stated that deadline";
}

TEST(Diagnoser, SaysWhatWasWrong) {
  TaskFigures task;
  task.stats = stats_of("control.loop", 10 * kMillisecond);
  task.stats.wcet = 2 * kMillisecond;
  task.stats.execution_max = 3 * kMillisecond;
  task.bound = TaskBound{4 * kMillisecond, "rta_preemptive", 2, 6 * kMillisecond};
  task.has_deadline = true;
  TaskFigures other;
  other.stats.id.kind = redag::Callback::Kind::Subscription;
  other.stats.id.node = "/lidar";
  other.stats.id.name = "/scan";
  other.stats.task = to_string(other.stats.id);
  TaskFigures idle = other;
  idle.stats.id.node = "/idle";
  other.stats.jobs.released = 3;
  TaskFigures internal = other;
  internal.stats.id.name = "/parameter_events";
  internal.stats.id.node = "/clock_node";
  Diagnoser diagnoser;
  const auto statuses = diagnoser.diagnose(snapshot_of({task, other, internal, idle}));

  const DiagnosticStatus *dag = find_status(statuses, "ReDAG: DAG control");
  ASSERT_NE(dag, nullptr);
  EXPECT_EQ(dag->level, DiagnosticStatus::WARN);
  EXPECT_THAT(dag->message, AllOf(HasSubstr("loop executed for 3ms, its wcet is 2ms"),
                                  HasSubstr("2 of loop responded above the bound of 4ms, at most in 6ms")));
  EXPECT_EQ(value_of(*dag, "loop period"), "10ms");
  EXPECT_EQ(value_of(*dag, "loop wcet"), "2ms");
  EXPECT_EQ(value_of(*dag, "loop bound"), "4ms");

  const DiagnosticStatus *node = find_status(statuses, "ReDAG: node /lidar");
  ASSERT_NE(node, nullptr);
  EXPECT_EQ(node->level, DiagnosticStatus::OK);
  EXPECT_EQ(value_of(*node, "subscription /scan released"), "3");
  EXPECT_EQ(find_status(statuses, "ReDAG: node /clock_node"), nullptr) << "ROS' own";
  EXPECT_EQ(find_status(statuses, "ReDAG: node /idle"), nullptr) << "never ran";
  EXPECT_NE(find_status(statuses, "ReDAG: executor"), nullptr);
}

TEST(DropIdleTasks, LeavesWhatCanBeAnalysed) {
  redag::Workload workload = parse(R"(
name: test
dags:
  - name: ros
    tasks:
      - {name: idle, period: 10ms, callback: {node: /a, waitable: any}}
      - {name: source, wcet: 1ms, callback: {node: /a, timer: 10ms}}
      - {name: sink, wcet: 1ms, activation: data, after: source, callback: {node: /b, subscription: /x}}
      - {name: orphan, wcet: 1ms, activation: data, after: idle, callback: {node: /b, subscription: /y}}
  - {name: control, tasks: [{name: loop, callback: {node: /robot, timer: 10ms}}]}
  - {name: unused, tasks: [{name: never, period: 10ms, callback: {node: /c, service: /c/s}}]}
)");
  drop_idle_tasks(workload, {"control"});
  ASSERT_EQ(workload.dags.size(), 2U);
  const redag::Dag &ros = workload.dags[0];
  ASSERT_EQ(ros.tasks.size(), 3U);
  EXPECT_EQ(ros.tasks[0].name, "source");
  EXPECT_THAT(ros.tasks[1].predecessors, ElementsAre(0));
  EXPECT_EQ(ros.tasks[1].activation, redag::Activation::Data);
  EXPECT_EQ(ros.tasks[2].name, "orphan");
  EXPECT_THAT(ros.tasks[2].predecessors, IsEmpty());
  EXPECT_EQ(ros.tasks[2].activation, redag::Activation::Timer);
  EXPECT_EQ(workload.dags[1].name, "control") << "as its file has it";
}

// ---- with an executor ----

void use_processor(std::chrono::nanoseconds amount) {
  const auto now = [] {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  };
  for (const auto start = now(); now() - start < amount;) {
  }
}

// What is logged, for as long as this lives.
class LogCapture {
 public:
  LogCapture() : before_(rcutils_logging_get_output_handler()) {
    lines().clear();
    rcutils_logging_set_output_handler(&keep);
  }
  ~LogCapture() { rcutils_logging_set_output_handler(before_); }

  [[nodiscard]] static int warnings_with(const std::string &text) {
    const std::lock_guard guard(lock());
    return static_cast<int>(std::count_if(
        lines().begin(), lines().end(), [&](const std::string &line) { return line.find(text) != std::string::npos; }));
  }

 private:
  static std::vector<std::string> &lines() {
    static std::vector<std::string> lines;
    return lines;
  }
  static std::mutex &lock() {
    static std::mutex lock;
    return lock;
  }
  static void keep(const rcutils_log_location_t *, int severity, const char *, rcutils_time_point_value_t,
                   const char *format, va_list *arguments) {
    if (severity < RCUTILS_LOG_SEVERITY_WARN) return;
    char text[2048];
    va_list copy;
    va_copy(copy, *arguments);
    vsnprintf(text, sizeof(text), format, copy);
    va_end(copy);
    const std::lock_guard guard(lock());
    lines().emplace_back(text);
  }

  rcutils_logging_output_handler_t before_;
};

class MonitorTest : public ::testing::Test {
 protected:
  void SetUp() override {
    rclcpp::init(0, nullptr);
    watching_.emplace();
    folder_ = std::filesystem::temp_directory_path() / ("redag_monitor_test_" + std::to_string(getpid()));
    node_ = std::make_shared<rclcpp::Node>("robot");
    options_.workers = 1;
    options_.preemption = redag::PreemptionMode::None;
    monitor_options_.period = 50ms;
    monitor_options_.save_path = folder_ / "learned.yaml";
    std::filesystem::create_directories(folder_);
  }

  void TearDown() override {
    stop();
    monitor_.reset();
    executor_.reset();
    timers_.clear();
    node_.reset();
    watching_.reset();
    watcher_.reset();
    if (rclcpp::ok()) rclcpp::shutdown();
    std::filesystem::remove_all(folder_);
  }

  void add_timer(std::chrono::nanoseconds period, std::function<void()> body) {
    timers_.push_back(node_->create_wall_timer(period, std::move(body)));
  }

  void configure(const char *workload) { options_.workload = monitor_options_.workload = parse(workload); }

  void start() {
    executor_ = std::make_unique<ReDAGExecutor>(options_);
    executor_->add_node(node_);
    monitor_ = std::make_unique<Monitor>(node_, *executor_, monitor_options_);
    spinner_ = std::thread([this] { executor_->spin(); });

    watcher_ = std::make_shared<rclcpp::Node>("watcher");
    diagnostics_subscription_ = watcher_->create_subscription<DiagnosticArray>(
        "/diagnostics", 10, [this](const DiagnosticArray &array) { diagnostics_.push_back(array.status); });
    metrics_subscription_ = watcher_->create_subscription<std_msgs::msg::String>(
        "/robot/metrics", rclcpp::QoS(1).transient_local(),
        [this](const std_msgs::msg::String &message) { metrics_.push_back(Json::parse(message.data)); });
    watching_->add_node(watcher_);
  }

  void stop() {
    if (!spinner_.joinable()) return;
    executor_->cancel();
    spinner_.join();
  }

  template <class Condition>
  bool eventually(Condition condition) {
    return redag_rclcpp::eventually(condition, [&] { watching_->spin_once(10ms); });
  }

  bool eventually_status(const std::string &name, unsigned char level, const std::string &text) {
    diagnostics_.clear();
    return eventually([&] {
      for (const auto &statuses : diagnostics_) {
        const DiagnosticStatus *status = find_status(statuses, name);
        if (status && status->level == level && status->message.find(text) != std::string::npos) return true;
      }
      return false;
    });
  }

  std_srvs::srv::Trigger::Response::SharedPtr call(const std::string &service) {
    const auto client = watcher_->create_client<std_srvs::srv::Trigger>(service);
    if (!client->wait_for_service(kLimit)) return nullptr;
    auto future = client->async_send_request(std::make_shared<std_srvs::srv::Trigger::Request>());
    if (watching_->spin_until_future_complete(future, kLimit) != rclcpp::FutureReturnCode::SUCCESS) return nullptr;
    return future.get();
  }

  static Json task_of(const Json &metrics, const std::string &name) {
    for (const Json &task : metrics["tasks"]) {
      if (task["task"] == name) return task;
    }
    return nullptr;
  }

  std::filesystem::path folder_;
  rclcpp::Node::SharedPtr node_;
  std::vector<rclcpp::TimerBase::SharedPtr> timers_;
  ReDAGOptions options_;
  MonitorOptions monitor_options_;
  std::unique_ptr<ReDAGExecutor> executor_;
  std::unique_ptr<Monitor> monitor_;
  std::thread spinner_;

  rclcpp::Node::SharedPtr watcher_;
  std::optional<rclcpp::executors::SingleThreadedExecutor> watching_;
  rclcpp::Subscription<DiagnosticArray>::SharedPtr diagnostics_subscription_;
  rclcpp::Subscription<std_msgs::msg::String>::SharedPtr metrics_subscription_;
  std::vector<std::vector<DiagnosticStatus>> diagnostics_;
  std::vector<Json> metrics_;
};

TEST_F(MonitorTest, ATaskThatMissesIsWarnedOfAlsoWhileNothingElseGetsToRun) {
  configure(kOneTimer);
  const auto slow = std::make_shared<std::atomic<bool>>(true);  // the timer goes on until TearDown
  add_timer(10ms, [slow] { std::this_thread::sleep_for(*slow ? 35ms : 0ms); });
  start();
  EXPECT_TRUE(eventually_status("ReDAG: DAG control", DiagnosticStatus::WARN, "loop missed"));
  *slow = false;
  EXPECT_TRUE(eventually_status("ReDAG: DAG control", DiagnosticStatus::OK, "no new misses"));
}

TEST_F(MonitorTest, AnExecutionTimeAboveTheStatedOneIsWarnedOf) {
  configure(kOneTimer);
  add_timer(10ms, [] { use_processor(3ms); });
  start();
  EXPECT_TRUE(eventually_status("ReDAG: DAG control", DiagnosticStatus::WARN, "its wcet is 2ms"));
}

TEST_F(MonitorTest, AResponseAboveItsBoundIsReportedByNameAndOnceInTheLog) {
  const LogCapture log;
  configure(kOneTimer);
  options_.trace_capacity = 1 << 14;
  add_timer(10ms, [] { std::this_thread::sleep_for(5ms); });
  start();
  EXPECT_TRUE(eventually_status("ReDAG: DAG control", DiagnosticStatus::WARN, "loop responded above the bound of 2ms"));
  EXPECT_TRUE(eventually([&] {
    return !metrics_.empty() && !task_of(metrics_.back(), "control.loop")["bound"].is_null() &&
           task_of(metrics_.back(), "control.loop")["bound"]["exceeded"] >= 3;
  }));
  const Json bound = task_of(metrics_.back(), "control.loop")["bound"];
  EXPECT_EQ(bound["response_ns"], 2 * kMillisecond);
  EXPECT_GE(bound["worst_ns"], 5 * kMillisecond);
  EXPECT_EQ(LogCapture::warnings_with("control.loop responded in"), 1);
}

TEST_F(MonitorTest, ServicesAnswer) {
  add_timer(10ms, [] {});
  start();
  ASSERT_TRUE(eventually(
      [&] { return !metrics_.empty() && task_of(metrics_.back(), "/robot timer 10 ms (0)")["finished"] >= 3; }));

  const auto metrics = call("/robot/metrics");
  ASSERT_NE(metrics, nullptr);
  EXPECT_TRUE(metrics->success);
  const Json json = Json::parse(metrics->message);
  EXPECT_EQ(json["format"], "redag.metrics/1");
  EXPECT_EQ(json["preemption"], "none");
  EXPECT_EQ(json["workers"], 1);
  const Json task = task_of(json, "/robot timer 10 ms (0)");
  EXPECT_EQ(task["period_ns"], 10 * kMillisecond);
  EXPECT_GE(task["released"], 3);
  EXPECT_EQ(task["released"].get<int>() >= task["finished"].get<int>(), true);

  const auto saved = call("/robot/save");
  ASSERT_NE(saved, nullptr);
  EXPECT_TRUE(saved->success) << saved->message;
  EXPECT_THAT(saved->message, HasSubstr((folder_ / "learned.yaml").string()));
  const auto loaded = redag::load_workload(folder_ / "learned.yaml", {.wcet_optional = true});
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  EXPECT_GT(loaded->workload.task_count(), 0U);

  // Another path, while running; and one that does not work.
  ASSERT_TRUE(node_->set_parameter({"save_path", (folder_ / "other.yaml").string()}).successful);
  EXPECT_TRUE(call("/robot/save")->success);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "other.yaml"));
  ASSERT_TRUE(node_->set_parameter({"save_path", "/nowhere/at/all.yaml"}).successful);
  const auto refused = call("/robot/save");
  EXPECT_FALSE(refused->success);
  EXPECT_THAT(refused->message, HasSubstr("/nowhere/at/all.yaml"));
}

TEST_F(MonitorTest, WhatIsSavedConfiguresTheNextRun) {
  add_timer(10ms, [] { use_processor(1ms); });
  start();
  ASSERT_TRUE(eventually(
      [&] { return !metrics_.empty() && task_of(metrics_.back(), "/robot timer 10 ms (0)")["finished"] >= 3; }));
  stop();
  const redag::Result<std::string> path = monitor_->save(folder_ / "saved.yaml");
  ASSERT_TRUE(path) << to_string(path.error());
  const auto loaded = redag::load_workload(*path, {.wcet_optional = true});
  ASSERT_TRUE(loaded) << to_string(loaded.error());

  ReDAGOptions next = options_;
  next.workload = loaded->workload;
  ReDAGExecutor executor(next);
  executor_->remove_node(node_);
  executor.add_node(node_);
  int configured = 0;
  for (const CallbackStats &stats : executor.stats()) {
    if (stats.id.kind != redag::Callback::Kind::Timer || stats.id.period != 10 * kMillisecond) continue;
    EXPECT_NE(stats.dag, "");
    EXPECT_GE(stats.wcet, 1 * kMillisecond);
    ++configured;
  }
  EXPECT_EQ(configured, 1);
  executor.remove_node(node_);
}

TEST_F(MonitorTest, ResultsAreWrittenWhenSpinningHasEnded) {
  configure(kOneTimer);
  options_.trace_capacity = 1 << 14;
  monitor_options_.trace = folder_ / "new" / "results";
  monitor_options_.metrics_file = folder_ / "last.json";
  add_timer(10ms, [] { use_processor(1ms); });
  start();
  ASSERT_TRUE(
      eventually([&] { return !metrics_.empty() && task_of(metrics_.back(), "control.loop")["finished"] >= 5; }));
  stop();
  const redag::Result<void> done = monitor_->finish();
  ASSERT_TRUE(done) << to_string(done.error());

  const std::filesystem::path results = monitor_options_.trace;
  const auto trace = redag::trace::read_trace(results / "events.jsonl");
  ASSERT_TRUE(trace) << to_string(trace.error());
  EXPECT_GT(trace->events.size(), 20U);
  EXPECT_EQ(trace->info.lost_events, 0U);
  const auto check = redag::metrics::check_trace(*trace, redag::metrics::rules_for(trace->info));
  EXPECT_TRUE(check.ok()) << check.to_string();
  for (const char *name : {"jobs.csv", "trace.json"})
    EXPECT_GT(std::filesystem::file_size(results / name), 100U) << name;
  const Json summary = Json::parse(std::ifstream(results / "summary.json"));
  EXPECT_GE(summary["total"]["finished"], 5);
  EXPECT_GE(task_of(Json::parse(std::ifstream(results / "metrics.json")), "control.loop")["finished"], 5);
  EXPECT_GE(task_of(Json::parse(std::ifstream(folder_ / "last.json")), "control.loop")["finished"], 5);
  EXPECT_TRUE(monitor_->finish()) << "once more does nothing";
}

TEST_F(MonitorTest, ATraceThatIsTooLongEndsEarlier) {
  const LogCapture log;
  options_.trace_capacity = 1 << 14;
  monitor_options_.trace = folder_ / "results";
  monitor_options_.trace_events = 25;
  add_timer(10ms, [] {});
  start();
  ASSERT_TRUE(eventually([] { return LogCapture::warnings_with("the trace ends here, at 25 events") == 1; }));
  stop();
  ASSERT_TRUE(monitor_->finish());
  const auto trace = redag::trace::read_trace(folder_ / "results" / "events.jsonl");
  ASSERT_TRUE(trace) << to_string(trace.error());
  EXPECT_EQ(trace->events.size(), 25U);
  EXPECT_EQ(trace->info.end, trace->events.back().time);
}

TEST_F(MonitorTest, AFolderThatCannotBeMadeIsSaidAtOnce) {
  monitor_options_.trace = "/proc/nowhere/results";
  executor_ = std::make_unique<ReDAGExecutor>(options_);
  try {
    const Monitor monitor(node_, *executor_, monitor_options_);
    FAIL() << "it was accepted";
  } catch (const std::runtime_error &error) {
    EXPECT_THAT(error.what(), HasSubstr("/proc/nowhere/results"));
  }
}

TEST_F(MonitorTest, ItCanGoWhileTheExecutorSpins) {
  monitor_options_.period = 1ms;
  add_timer(5ms, [] {});
  start();
  ASSERT_TRUE(eventually([&] { return metrics_.size() >= 3; }));
  monitor_.reset();
  const auto finished = [&] {
    std::uint64_t count = 0;
    for (const CallbackStats &stats : executor_->stats()) {
      if (stats.id.period == 5 * kMillisecond) count = stats.jobs.finished;
    }
    return count;
  };
  const std::uint64_t before = finished();
  EXPECT_TRUE(eventually([&] { return finished() > before + 3; }));
}

}  // namespace
}  // namespace redag_rclcpp
