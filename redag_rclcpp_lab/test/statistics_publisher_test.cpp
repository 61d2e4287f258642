// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Real publishers and subscriptions, which subscribe as PlotJuggler's plugin and rosbag2 do: latched if all publishers
// offer it, otherwise not.
#include "statistics_publisher.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <memory>
#include <thread>

#include "live_frames.hpp"
#include "rclcpp/serialization.hpp"
#include "redag/live/writer.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using pal_statistics_msgs::msg::Statistics;
using pal_statistics_msgs::msg::StatisticsNames;
using pal_statistics_msgs::msg::StatisticsValues;
using redag::live::PageWriter;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Lt;
using ::testing::Not;
using ::testing::SizeIs;

/// What arrives, matched as PlotJuggler does it: a value counts only if the names of its version are there.
class Reader {
 public:
  explicit Reader(bool latched = true) : node_(std::make_shared<rclcpp::Node>("reader")) {
    rclcpp::QoS qos(10);
    if (latched) qos.transient_local();
    subscriptions_.push_back(node_->create_subscription<StatisticsNames>(
        "/statistics/names", qos, [this](StatisticsNames::ConstSharedPtr names) {
          names_of[names->names_version] = names->names;
          ++names_received;
        }));
    subscriptions_.push_back(node_->create_subscription<StatisticsValues>(
        "/statistics/values", 10, [this](StatisticsValues::ConstSharedPtr values) {
          ++values_received;
          version = values->names_version;
          const auto names = names_of.find(version);
          if (names == names_of.end()) return;
          ASSERT_EQ(names->second.size(), values->values.size());
          matched.clear();
          for (std::size_t i = 0; i < values->values.size(); ++i) matched[names->second[i]] = values->values[i];
        }));
    subscriptions_.push_back(node_->create_subscription<Statistics>(
        "/statistics/full", 10, [this](Statistics::ConstSharedPtr message) { full = *message; }));
    executor_.add_node(node_);
  }

  /// Calls `publish` until `condition` holds.
  template <class Condition, class Publish>
  [[nodiscard]] bool until(Condition condition, Publish publish) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      publish();
      executor_.spin_some();
      std::this_thread::sleep_for(1ms);
    }
    return true;
  }

  std::map<std::uint32_t, std::vector<std::string>> names_of;
  std::map<std::string, double> matched;
  std::uint32_t version = 0;
  std::size_t names_received = 0;
  std::size_t values_received = 0;
  Statistics full;

 private:
  rclcpp::Node::SharedPtr node_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  rclcpp::executors::SingleThreadedExecutor executor_;
};

class StatisticsPublisherTest : public testing::Test {
 protected:
  void SetUp() override {
    rclcpp::init(0, nullptr);
    char name[] = "/tmp/redag_statistics_XXXXXX";
    ASSERT_NE(mkdtemp(name), nullptr);
    folder_ = name;
    auto writer = PageWriter::create(folder_);
    ASSERT_TRUE(writer) << to_string(writer.error());
    writer_ = *std::move(writer);
    writer_->publish(frame_);
    publisher_ = std::make_unique<StatisticsPublisher>(std::make_shared<rclcpp::Node>("statistics"), folder_,
                                                       std::set<std::string, std::less<>>());
  }
  void TearDown() override {
    publisher_.reset();
    writer_.reset();
    rclcpp::shutdown();
    std::filesystem::remove_all(folder_);
  }

  redag::live::Frame frame_ = small_frame();
  std::string folder_;
  std::unique_ptr<PageWriter> writer_;
  std::unique_ptr<StatisticsPublisher> publisher_;
};

TEST_F(StatisticsPublisherTest, NamesAndValuesAreThoseOfThePage) {
  Reader reader;
  const auto publish = [this] { publisher_->publish(); };
  ASSERT_TRUE(reader.until([&] { return !reader.matched.empty() && !reader.full.statistics.empty(); }, publish));
  LiveStatistics expected({}, 1);
  expected.update(redag::live::list_pages(folder_), 0);
  ASSERT_EQ(reader.matched.size(), expected.names().size());
  for (std::size_t i = 0; i < expected.names().size(); ++i) {
    if (expected.names()[i] == "robot/page_age") continue;  // depends on the moment
    EXPECT_EQ(reader.matched.at(expected.names()[i]), expected.values()[i]) << expected.names()[i];
    EXPECT_EQ(reader.full.statistics.at(i).name, expected.names()[i]);
    EXPECT_EQ(reader.full.statistics.at(i).value, expected.values()[i]);
  }
  EXPECT_EQ(reader.matched.at("robot/control/pid/response_p99"), 0.003);
}

TEST_F(StatisticsPublisherTest, ANewCallbackChangesTheVersion) {
  Reader reader;
  const auto publish = [this] { publisher_->publish(); };
  ASSERT_TRUE(reader.until([&] { return !reader.matched.empty(); }, publish));
  const std::uint32_t before = reader.version;
  EXPECT_THAT(reader.names_of[before], Not(Contains("robot/control/log/released")));
  frame_.tasks.push_back({.name = "log", .dag = 0});
  frame_.tasks.back().figures.released = 5;
  writer_->publish(frame_);
  ASSERT_TRUE(reader.until([&] { return reader.matched.count("robot/control/log/released") > 0; }, publish));
  EXPECT_EQ(reader.version, before + 1);
  EXPECT_EQ(reader.matched["robot/control/log/released"], 5);
  EXPECT_THAT(reader.names_of, SizeIs(2));
}

TEST_F(StatisticsPublisherTest, NamesAreSentOnceToAReaderThatIsThere) {
  Reader reader;
  const auto publish = [this] { publisher_->publish(); };
  ASSERT_TRUE(reader.until([&] { return reader.values_received >= 20; }, publish));
  // A latched one, and one when the publisher saw the subscription.
  EXPECT_THAT(reader.names_received, Lt(4U));
}

TEST_F(StatisticsPublisherTest, ALateReaderGetsTheNames) {
  publisher_->publish();  // without any reader
  Reader reader;
  ASSERT_TRUE(reader.until([&] { return reader.names_received > 0; }, [] {}));  // without publishing anything
  EXPECT_THAT(reader.names_of.begin()->second, Contains("robot/control/pid/response_p99"));
  const std::uint32_t latched = reader.names_of.begin()->first;
  ASSERT_TRUE(reader.until([&] { return !reader.matched.empty(); }, [this] { publisher_->publish(); }));
  EXPECT_EQ(reader.version, latched);
}

TEST_F(StatisticsPublisherTest, AReaderThatAsksForNoLatchedNamesGetsThem) {
  publisher_->publish();
  Reader reader(false);
  ASSERT_TRUE(reader.until([&] { return !reader.matched.empty(); }, [this] { publisher_->publish(); }));
  EXPECT_EQ(reader.matched.at("robot/control/pid/misses"), 4);
}

TEST_F(StatisticsPublisherTest, AThousandCallbacksFit) {
  writer_->publish(large_frame(1000));
  Reader reader;
  const auto publish = [this] { publisher_->publish(); };
  ASSERT_TRUE(reader.until([&] { return !reader.matched.empty(); }, publish));
  EXPECT_EQ(reader.matched.at("left_out"), 0);
  EXPECT_EQ(reader.matched.at("large/pipeline_99/perception/camera_99/subscription /perception/image_999 (0)/released"),
            999);
  const auto size_of = [](const auto &message) {
    rclcpp::SerializedMessage serialized;
    rclcpp::Serialization<std::decay_t<decltype(message)>>().serialize_message(&message, &serialized);
    return serialized.size();
  };
  StatisticsValues values;
  values.values.resize(reader.matched.size());
  StatisticsNames names;
  names.names = reader.names_of[reader.version];
  RecordProperty("values_bytes", static_cast<int>(size_of(values)));
  RecordProperty("names_bytes", static_cast<int>(size_of(names)));
  EXPECT_LE(size_of(values), 8 * (kMostStatistics + 3) + 64);
  EXPECT_LE(size_of(values), 300'000U);
  EXPECT_LE(size_of(names), 4'000'000U);
}

// The names of callbacks that no file names, and a page that a running executor keeps up to date.
TEST_F(StatisticsPublisherTest, ShowsARunningExecutor) {
  ReDAGOptions options;
  options.live = true;
  options.learn = 0s;
  ReDAGExecutor executor(options);
  const auto robot = std::make_shared<rclcpp::Node>("robot");
  const auto timer = robot->create_wall_timer(10ms, [] {});
  executor.add_node(robot);
  std::thread spinner([&executor] { executor.spin(); });
  const std::string path = redag::live::page_path(redag::live::kFolder, ::getpid(), 0);
  StatisticsPublisher publisher(std::make_shared<rclcpp::Node>("statistics"), redag::live::kFolder,
                                {"released", "recent_response_p99", "period"});
  Reader reader;
  std::string name;
  const auto is_there = [&] {
    for (const auto &[each, value] : reader.matched) {
      if (each.find("/robot/timer 10 ms (0)/released") != std::string::npos && value > 10) name = each;
    }
    return !name.empty();
  };
  const bool was_seen = reader.until(is_there, [&publisher] { publisher.publish(); });
  const auto page = redag::live::read_page(path);
  executor.cancel();
  spinner.join();
  ASSERT_TRUE(was_seen);
  ASSERT_TRUE(page) << to_string(page.error());
  std::uint64_t released = 0;
  for (const redag::live::TaskFrame &task : page->frame.tasks) {
    if (task.name == "/robot timer 10 ms (0)") released = task.figures.released;
  }
  EXPECT_LE(reader.matched.at(name), static_cast<double>(released));
  EXPECT_GT(reader.matched.at(name), 10);
  const std::string callback = name.substr(0, name.rfind('/'));
  EXPECT_EQ(reader.matched.at(callback + "/period"), 0.01);
  EXPECT_EQ(reader.matched.count(callback + "/recent_response_p99"), 1U);
}

}  // namespace
}  // namespace redag_rclcpp::lab
