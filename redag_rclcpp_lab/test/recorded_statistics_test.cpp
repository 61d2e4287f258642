// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// rosbag2's Recorder beside the publisher of statistics: the bag has each published value, under its name.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bag_recording.hpp"
#include "live_frames.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp/serialization.hpp"
#include "redag/live/writer.hpp"
#include "rosbag2_transport/recorder.hpp"
#include "statistics_publisher.hpp"

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using pal_statistics_msgs::msg::Statistics;
using pal_statistics_msgs::msg::StatisticsNames;
using pal_statistics_msgs::msg::StatisticsValues;
using redag::live::PageWriter;
using ::testing::Contains;
using ::testing::SizeIs;

constexpr const char *kNames = "/statistics/names";
constexpr const char *kValues = "/statistics/values";
constexpr const char *kFull = "/statistics/full";
constexpr const char *kCounted = "robot/control/pid/released";
constexpr const char *kLater = "robot/control/log/released";

using Figures = std::map<std::string, double>;

/// What a bag has of the statistics.
struct Recorded {
  std::map<std::uint32_t, std::vector<std::string>> names;
  std::vector<StatisticsValues> values;
  std::vector<Figures> full;
};

template <class Message>
Message message_of(const RecordedMessage &recorded) {
  Message message;
  rclcpp::Serialization<Message>().deserialize_message(&recorded.data, &message);
  return message;
}

Recorded read(const std::string &folder) {
  Recorded result;
  const auto bag = open_bag(folder, {});
  EXPECT_TRUE(bag) << to_string(bag.error());
  if (!bag) return result;
  for (RecordedMessage message; *(*bag)->next(message);) {
    const std::string &topic = (*bag)->topics().at(message.topic).name;
    if (topic == kNames) {
      const auto names = message_of<StatisticsNames>(message);
      result.names[names.names_version] = names.names;
    } else if (topic == kValues) {
      result.values.push_back(message_of<StatisticsValues>(message));
    } else {
      EXPECT_EQ(topic, kFull);
      Figures figures;
      for (const auto &each : message_of<Statistics>(message).statistics) figures[each.name] = each.value;
      result.full.push_back(std::move(figures));
    }
  }
  return result;
}

/// The recorded values, each with its name of the recorded names.
std::vector<Figures> with_names(const Recorded &recorded) {
  std::vector<Figures> all;
  for (const StatisticsValues &values : recorded.values) {
    const auto names = recorded.names.find(values.names_version);
    EXPECT_NE(names, recorded.names.end()) << "no names of version " << values.names_version;
    if (names == recorded.names.end()) continue;
    EXPECT_THAT(values.values, SizeIs(names->second.size()));
    Figures figures;
    for (std::size_t i = 0; i < values.values.size(); ++i) figures[names->second.at(i)] = values.values[i];
    all.push_back(std::move(figures));
  }
  return all;
}

/// Checks that one after the other has a counter of 0, 1, 2 and on, until `published`.
void check_counted(const std::vector<Figures> &all, std::size_t published) {
  ASSERT_GE(all.size(), published);
  for (std::size_t i = 0; i < published; ++i) {
    ASSERT_THAT(all[i], Contains(testing::Key(kCounted)));
    EXPECT_EQ(all[i].at(kCounted), static_cast<double>(i));
    EXPECT_EQ(all[i].count(kLater), i >= published / 2 ? 1U : 0U) << "message " << i;
  }
}

class RecordedStatisticsTest : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    rclcpp::init(0, nullptr);
    std::string name = (std::filesystem::temp_directory_path() / "redag_bag_XXXXXX").string();
    ASSERT_NE(mkdtemp(name.data()), nullptr);
    folder_ = name;
    std::filesystem::create_directory(folder_ + "/pages");
  }
  void TearDown() override {
    rclcpp::shutdown();
    std::filesystem::remove_all(folder_);
  }

  std::string folder_;
};

TEST_P(RecordedStatisticsTest, HaveEachValueUnderItsName) {
  constexpr std::size_t kPublished = 40;
  // A subscription that got a message leaves the Recorder, which one thread serves too, at most one behind.
  constexpr std::size_t kMore = 3;
  const std::string bag = folder_ + "/bag";
  {
    auto writer = PageWriter::create(folder_ + "/pages");
    ASSERT_TRUE(writer) << to_string(writer.error());
    redag::live::Frame frame = small_frame();
    const auto node = std::make_shared<rclcpp::Node>("statistics");
    StatisticsPublisher publisher(node, folder_ + "/pages", std::set<std::string, std::less<>>());
    const auto recorder = std::make_shared<rosbag2_transport::Recorder>(
        rclcpp::NodeOptions().parameter_overrides({{"storage.uri", bag},
                                                   {"storage.storage_id", GetParam()},
                                                   {"record.topics", std::vector<std::string>{kNames, kValues, kFull}},
                                                   {"record.disable_keyboard_controls", true}}));
    const auto reader = std::make_shared<rclcpp::Node>("reader");
    std::size_t full = 0;
    std::size_t values = 0;
    const auto of_values =
        reader->create_subscription<StatisticsValues>(kValues, 10, [&](const StatisticsValues &) { ++values; });
    const auto of_full = reader->create_subscription<Statistics>(kFull, 10, [&](const Statistics &) { ++full; });
    rclcpp::executors::SingleThreadedExecutor executor;
    executor.add_node(recorder);
    executor.add_node(reader);
    const auto end = std::chrono::steady_clock::now() + 60s;
    const auto await = [&](auto condition) {
      while (!condition() && std::chrono::steady_clock::now() < end) executor.spin_once(10ms);
      return condition();
    };
    // The Recorder subscribes when its own thread has found the topics.
    ASSERT_TRUE(await([&] {
      return node->count_subscribers(kNames) == 1 && node->count_subscribers(kValues) == 2 &&
             node->count_subscribers(kFull) == 2;
    }));
    for (std::size_t i = 0; i < kPublished + kMore; ++i) {
      if (i == kPublished / 2) frame.tasks.push_back({.name = "log", .dag = 0});  // names change
      frame.tasks[0].figures.released = i;
      (*writer)->publish(frame);
      publisher.publish();
      ASSERT_TRUE(await([&] { return values > i && full > i; })) << "message " << i;
    }
    recorder->stop();
  }
  const Recorded recorded = read(bag);
  EXPECT_THAT(recorded.names, SizeIs(2));
  const std::vector<Figures> named = with_names(recorded);
  check_counted(named, kPublished);
  check_counted(recorded.full, kPublished);
  for (std::size_t i = 0; i < kPublished; ++i) EXPECT_EQ(named.at(i), recorded.full.at(i)) << "message " << i;
}

INSTANTIATE_TEST_SUITE_P(Storages, RecordedStatisticsTest, testing::Values("mcap", "sqlite3"),
                         [](const auto &storage) { return storage.param; });

}  // namespace
}  // namespace redag_rclcpp::lab
