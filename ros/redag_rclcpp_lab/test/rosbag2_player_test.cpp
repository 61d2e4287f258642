// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An executor whose messages and /clock come from rosbag2's Player.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"
#include "redag/derived/rng.hpp"
#include "redag_rclcpp/executor.hpp"
#include "rosbag2_cpp/writer.hpp"
#include "rosbag2_storage/storage_options.hpp"
#include "rosbag2_transport/player.hpp"
#include "std_msgs/msg/u_int64.hpp"

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using redag::kMillisecond;
using redag::Time;
using std_msgs::msg::UInt64;

constexpr std::array kTopics = {"/scan", "/odom", "/imu"};
constexpr Time kStart = 1'700'000'000 * redag::kSecond;

/// A bag with messages on all topics, about one every 2 ms. Each is larger than those before it.
struct Bag {
  explicit Bag(const std::string &folder) {
    rosbag2_cpp::Writer writer;
    rosbag2_storage::StorageOptions storage;
    storage.uri = folder;
    storage.storage_id = "mcap";
    writer.open(storage);
    redag::Rng random(7);
    for (std::uint64_t i = 1; i <= 500; ++i, end += random.uniform(1, 3) * kMillisecond) {
      const auto topic = static_cast<std::size_t>(random.uniform(0, 2));
      UInt64 message;
      message.data = i;
      writer.write(message, kTopics.at(topic), rclcpp::Time(end));
      ++messages.at(topic);
    }
  }
  std::array<std::uint64_t, kTopics.size()> messages{};
  Time end = kStart;
};

TEST(Rosbag2Player, PlaysToAnExecutorInSimulatedTime) {
  rclcpp::init(0, nullptr);
  std::string folder = (std::filesystem::temp_directory_path() / "redag_bag_XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  {
    const Bag bag(folder + "/bag");
    const auto robot =
        std::make_shared<rclcpp::Node>("robot", rclcpp::NodeOptions().parameter_overrides({{"use_sim_time", true}}));
    std::array<std::atomic<std::uint64_t>, kTopics.size()> heard{};
    std::array<std::uint64_t, kTopics.size()> last{};  // each is of one callback
    std::atomic<std::uint64_t> ticks = 0;
    std::atomic<bool> in_order = true;
    std::atomic<bool> in_recording = true;
    std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions;
    for (std::size_t i = 0; i < kTopics.size(); ++i) {
      subscriptions.push_back(robot->create_subscription<UInt64>(kTopics.at(i), rclcpp::QoS(1000).reliable(),
                                                                 [&, i](const UInt64 &message) {
                                                                   if (message.data <= last.at(i)) in_order = false;
                                                                   last.at(i) = message.data;
                                                                   ++heard.at(i);
                                                                 }));
    }
    const auto timer = rclcpp::create_timer(robot, robot->get_clock(), rclcpp::Duration(20ms), [&] {
      const Time now = robot->now().nanoseconds();
      if (now < kStart || now > bag.end + 100 * kMillisecond) in_recording = false;
      ++ticks;
    });
    const auto player = std::make_shared<rosbag2_transport::Player>(
        rclcpp::NodeOptions().parameter_overrides({{"storage.uri", folder + "/bag"},
                                                   {"play.start_paused", true},
                                                   {"play.clock_publish_frequency", 200.0},
                                                   {"play.disable_keyboard_controls", true}}));
    ReDAGExecutor executor;
    executor.add_node(robot);
    rclcpp::executors::SingleThreadedExecutor of_player;
    of_player.add_node(player);
    std::thread spinner([&] { executor.spin(); });
    std::thread player_spinner([&] { of_player.spin(); });
    const auto limit = std::chrono::steady_clock::now() + 60s;
    const auto await = [&](auto condition) {
      bool is_so = false;
      while (!(is_so = condition()) && std::chrono::steady_clock::now() < limit) std::this_thread::sleep_for(5ms);
      return is_so;
    };
    EXPECT_TRUE(await([&] {
      for (const auto &subscription : subscriptions) {
        if (subscription->get_publisher_count() == 0) return false;
      }
      return true;
    }));
    player->resume();
    EXPECT_TRUE(await([&] {
      for (std::size_t i = 0; i < kTopics.size(); ++i) {
        if (heard.at(i) < bag.messages.at(i)) return false;
      }
      return true;
    }));
    executor.cancel();
    of_player.cancel();
    spinner.join();
    player_spinner.join();
    for (std::size_t i = 0; i < kTopics.size(); ++i) EXPECT_EQ(heard.at(i), bag.messages.at(i)) << kTopics.at(i);
    EXPECT_TRUE(in_order);
    EXPECT_TRUE(in_recording);
    // 50 without stalls. rclcpp leaves out calls that come too late.
    EXPECT_GE(ticks, 3U);
    EXPECT_LE(ticks, static_cast<std::uint64_t>((bag.end - kStart) / (20 * kMillisecond)) + 3);
  }
  std::filesystem::remove_all(folder);
  rclcpp::shutdown();
}

}  // namespace
}  // namespace redag_rclcpp::lab
