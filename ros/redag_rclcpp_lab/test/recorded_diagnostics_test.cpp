// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// rosbag2's Recorder, which runs on the executor that it records: the bag has the executor's diagnostics.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp/serialization.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_rclcpp/executor.hpp"
#include "redag_rclcpp/monitor.hpp"
#include "rosbag2_cpp/reader.hpp"
#include "rosbag2_storage/storage_filter.hpp"
#include "rosbag2_transport/recorder.hpp"

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using diagnostic_msgs::msg::DiagnosticArray;
using diagnostic_msgs::msg::DiagnosticStatus;
using testing::HasSubstr;

constexpr const char *kOneTimer = R"(
name: test
dags:
  - {name: control, tasks: [{name: loop, wcet: 2ms, callback: {node: /robot, timer: 10ms}}]}
)";

/// Reads all diagnostics of a bag.
std::vector<DiagnosticArray> diagnostics_of(const std::string &folder) {
  rosbag2_cpp::Reader bag;
  bag.open(folder);
  rosbag2_storage::StorageFilter filter;
  filter.topics = {"/diagnostics"};
  bag.set_filter(filter);
  std::vector<DiagnosticArray> all;
  redag::Time last = 0;
  while (bag.has_next()) {
    const auto recorded = bag.read_next();
    const rclcpp::SerializedMessage message(*recorded->serialized_data);
    DiagnosticArray array;
    rclcpp::Serialization<DiagnosticArray>().deserialize_message(&message, &array);
    // The middleware's time of arrival, which the executor passes on to the Recorder.
    EXPECT_GE(recorded->recv_timestamp, rclcpp::Time(array.header.stamp).nanoseconds());
    EXPECT_GE(recorded->recv_timestamp, last);
    last = recorded->recv_timestamp;
    all.push_back(array);
  }
  return all;
}

TEST(RecordedDiagnostics, TellOfMisses) {
  rclcpp::init(0, nullptr);
  std::string folder = (std::filesystem::temp_directory_path() / "redag_bag_XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  const std::string bag = folder + "/bag";
  {
    const auto workload = redag::parse_workload(kOneTimer, "test.yaml", redag::LoadOptions{.wcet_optional = true});
    ASSERT_TRUE(workload) << to_string(workload.error());
    ReDAGOptions options;
    options.workers = 2;
    options.workload = redag::validated(workload->workload).value();
    MonitorOptions monitored;
    monitored.period = 50ms;
    monitored.workload = workload->workload;
    const auto robot = std::make_shared<rclcpp::Node>("robot");
    const auto recorder = std::make_shared<rosbag2_transport::Recorder>(
        rclcpp::NodeOptions().parameter_overrides({{"storage.uri", bag},
                                                   {"storage.storage_id", "mcap"},
                                                   {"record.topics", std::vector<std::string>{"/diagnostics"}},
                                                   {"record.disable_keyboard_controls", true}}));
    ReDAGExecutor executor(options);
    executor.add_node(robot);
    executor.add_node(recorder);
    std::atomic<bool> slow = true;
    const auto timer = robot->create_wall_timer(10ms, [&] { std::this_thread::sleep_for(slow ? 35ms : 0ms); });
    const auto watcher = std::make_shared<rclcpp::Node>("watcher");
    std::atomic<int> seen = 0;
    const auto subscription =
        watcher->create_subscription<DiagnosticArray>("/diagnostics", 10, [&](const DiagnosticArray &) { ++seen; });
    executor.add_node(watcher);
    Monitor monitor(robot, executor, monitored);
    std::thread spinner([&] { executor.spin(); });
    // The Recorder subscribes when its own thread has found the topic.
    const auto end = std::chrono::steady_clock::now() + 60s;
    const auto await = [&](auto condition) {
      while (!condition() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(10ms);
    };
    await([&] { return recorder->count_subscribers("/diagnostics") >= 2; });
    EXPECT_EQ(recorder->count_subscribers("/diagnostics"), 2U);
    const int before = seen;
    await([&] { return seen >= before + 10; });
    slow = false;
    const int between = seen;
    await([&] { return seen >= between + 10; });
    executor.cancel();
    spinner.join();
    recorder->stop();
  }
  const std::vector<DiagnosticArray> recorded = diagnostics_of(bag);
  EXPECT_GE(recorded.size(), 10U);
  int missed = 0;
  int well = 0;
  int of_executor = 0;
  for (const DiagnosticArray &array : recorded) {
    for (const DiagnosticStatus &status : array.status) {
      of_executor += status.name == "ReDAG: executor";
      if (status.name != "ReDAG: DAG control") continue;
      missed += status.level == DiagnosticStatus::WARN && status.message.find("loop missed") != std::string::npos;
      well += status.level == DiagnosticStatus::OK;
    }
  }
  EXPECT_GE(missed, 1);
  EXPECT_GE(well, 1);
  EXPECT_EQ(of_executor, static_cast<int>(recorded.size()));
  std::filesystem::remove_all(folder);
  rclcpp::shutdown();
}

}  // namespace
}  // namespace redag_rclcpp::lab
