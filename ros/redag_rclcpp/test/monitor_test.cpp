// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the monitor with a real executor: its reports, their timing, and its files.
#include "redag_rclcpp/monitor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "log_capture.hpp"
#include "monitor_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/live/pages.hpp"
#include "redag/live/reader.hpp"
#include "redag/live/writer.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "spinning.hpp"
#include "std_msgs/msg/string.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using diagnostic_msgs::msg::DiagnosticArray;
using redag::kMillisecond;
using ::testing::HasSubstr;
using Json = nlohmann::json;

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

  void configure(const char *workload) {
    monitor_options_.workload = parse(workload);
    options_.workload = valid(workload);
  }

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
  const auto slow = std::make_shared<std::atomic<bool>>(true);  // shared: the timer runs until TearDown()
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
  EXPECT_TRUE(
      eventually_status("ReDAG: DAG control", DiagnosticStatus::WARN, "responses of loop exceeded the bound of 2ms"));
  EXPECT_TRUE(eventually([&] {
    return !metrics_.empty() && !task_of(metrics_.back(), "control.loop")["bound"].is_null() &&
           task_of(metrics_.back(), "control.loop")["bound"]["exceeded"] >= 3;
  }));
  const Json bound = task_of(metrics_.back(), "control.loop")["bound"];
  EXPECT_EQ(bound["response_ns"], 2 * kMillisecond);
  EXPECT_GE(bound["worst_ns"], 5 * kMillisecond);
  EXPECT_EQ(LogCapture::warnings_with("the response time of control.loop was"), 1);
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

  // Saves to another path while the executor spins, and then to an invalid one.
  ASSERT_TRUE(node_->set_parameter({"save_path", (folder_ / "other.yaml").string()}).successful);
  EXPECT_TRUE(call("/robot/save")->success);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "other.yaml"));
  ASSERT_TRUE(node_->set_parameter({"save_path", "/nowhere/at/all.yaml"}).successful);
  const auto refused = call("/robot/save");
  EXPECT_FALSE(refused->success);
  EXPECT_THAT(refused->message, HasSubstr("/nowhere/at/all.yaml"));
}

TEST_F(MonitorTest, SegmentsOfTheFileAreSavedAndAPageIsOptional) {
  configure(R"(
name: test
dags:
  - name: control
    tasks: [{name: sees, segments: [{cpu: 2ms}, {wait: 3ms}, {cpu: 2ms}], callback: {node: /robot, timer: 10ms}}]
)");
  monitor_options_.live = false;
  add_timer(10ms, [] { use_processor(1ms); });
  start();
  ASSERT_TRUE(
      eventually([&] { return !metrics_.empty() && task_of(metrics_.back(), "control.sees")["finished"] >= 3; }));
  EXPECT_FALSE(redag::live::read_page(redag::live::page_path(redag::live::kFolder, ::getpid(), 0)));
  stop();
  const redag::Result<std::string> path = monitor_->save(folder_ / "saved.yaml");
  ASSERT_TRUE(path) << to_string(path.error());
  const auto loaded = redag::load_workload(*path, {.wcet_optional = true, .waits = true});
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  EXPECT_EQ(loaded->workload.dags.at(0).tasks.at(0).waits.size(), 1U);
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
  next.workload = redag::validated(loaded->workload).value();
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
  add_timer(10ms, [] { use_processor(1ms); });
  start();
  ASSERT_TRUE(
      eventually([&] { return !metrics_.empty() && task_of(metrics_.back(), "control.loop")["finished"] >= 5; }));
  stop();
  const redag::Result<void> done = monitor_->finish();
  ASSERT_TRUE(done) << to_string(done.error());

  const std::filesystem::path results = monitor_options_.trace;
  const auto trace = redag::trace::read_trace(results / "events.redag");
  ASSERT_TRUE(trace) << to_string(trace.error());
  EXPECT_GT(trace->events.size(), 20U);
  EXPECT_EQ(trace->info.lost_events, 0U);
  const auto check = redag::metrics::check_trace(*trace, redag::metrics::rules_for(trace->info));
  EXPECT_TRUE(check.ok()) << check.to_string();
  for (const char *name : {"jobs.csv", "trace.pftrace"})
    EXPECT_GT(std::filesystem::file_size(results / name), 100U) << name;
  const Json summary = Json::parse(std::ifstream(results / "summary.json"));
  EXPECT_GE(summary["total"]["finished"], 5);
  EXPECT_GE(task_of(Json::parse(std::ifstream(results / "metrics.json")), "control.loop")["finished"], 5);
  EXPECT_TRUE(monitor_->finish()) << "once more does nothing";
}

// What a killed process leaves.
TEST_F(MonitorTest, ARecordIsThereWhileItSpins) {
  options_.trace_capacity = 1 << 14;
  monitor_options_.trace = folder_ / "results";
  const std::filesystem::path record = folder_ / "results" / "events.redag";
  std::filesystem::create_directories(record.parent_path());
  std::ofstream(record) << "of an earlier process";
  add_timer(10ms, [] {});
  start();
  EXPECT_TRUE(std::filesystem::exists(folder_ / "results" / "events.1.redag")) << "it is moved aside";
  redag::Result<redag::trace::Trace> recorded;
  ASSERT_TRUE(eventually([&] {
    recorded = redag::trace::read_trace(record);
    return recorded && recorded->events.size() > 5;
  }));
  EXPECT_EQ(recorded->info.driver, redag::trace::Driver::Ros);
  EXPECT_EQ(recorded->info.remarks.size(), 1U) << "it goes on";
  stop();
  ASSERT_TRUE(monitor_->finish());
  recorded = redag::trace::read_trace(record);
  ASSERT_TRUE(recorded) << to_string(recorded.error());
  EXPECT_TRUE(recorded->info.remarks.empty()) << "the results are written";
}

TEST_F(MonitorTest, ATraceThatIsTooLongEndsEarlier) {
  const LogCapture log;
  options_.trace_capacity = 1 << 14;
  monitor_options_.trace = folder_ / "results";
  monitor_options_.trace_events = 25;
  add_timer(10ms, [] {});
  start();
  ASSERT_TRUE(eventually([] { return LogCapture::warnings_with("the trace ends here, after 25 events") == 1; }));
  stop();
  ASSERT_TRUE(monitor_->finish());
  const auto trace = redag::trace::read_trace(folder_ / "results" / "events.redag");
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
