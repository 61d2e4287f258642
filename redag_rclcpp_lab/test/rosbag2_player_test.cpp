// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An executor in lockstep whose messages and /clock come from rosbag2's Player, which waits for no answer: everything
// runs, as messages come.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "recordings.hpp"
#include "redag_rclcpp/executor.hpp"
#include "rosbag2_transport/player.hpp"
#include "std_msgs/msg/u_int64.hpp"
#include "written_bag.hpp"

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using redag::kMillisecond;
using redag::Time;
using std_msgs::msg::UInt64;

constexpr std::size_t kTopics = 3;

TEST(Rosbag2Player, PlaysToAnExecutorInLockstep) {
  rclcpp::init(0, nullptr);
  {
    RandomRecording recording(200);
    std::array<std::uint64_t, kTopics> recorded{};
    Time end = kStart;
    for (RecordedMessage message; *recording.next(message);) {
      ++recorded.at(message.topic);
      end = message.time;
    }
    ASSERT_TRUE(recording.rewind());
    const WrittenBag bag(recording);

    const auto robot =
        std::make_shared<rclcpp::Node>("robot", rclcpp::NodeOptions().parameter_overrides({{"use_sim_time", true}}));
    std::array<std::atomic<std::uint64_t>, kTopics> heard{};
    std::array<std::uint64_t, kTopics> last{};  // callbacks run one at a time
    std::atomic<std::uint64_t> ticks = 0;
    std::atomic<bool> in_order = true;
    std::atomic<bool> in_recording = true;
    std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions;
    for (std::size_t i = 0; i < kTopics; ++i) {
      subscriptions.push_back(robot->create_subscription<UInt64>(
          recording.topics()[i].name, rclcpp::QoS(1000).reliable(), [&, i](const UInt64 &message) {
            // The numbers of one instant fall, and those of a later one are larger.
            if (message.data / 10 < last.at(i) / 10) in_order = false;
            last.at(i) = message.data;
            ++heard.at(i);
          }));
    }
    const auto timer = rclcpp::create_timer(robot, robot->get_clock(), rclcpp::Duration(20ms), [&] {
      const Time now = robot->now().nanoseconds();
      if (now < kStart || now > end + 100 * kMillisecond) in_recording = false;
      ++ticks;
    });
    const auto player = std::make_shared<rosbag2_transport::Player>(
        rclcpp::NodeOptions().parameter_overrides({{"storage.uri", bag.path()},
                                                   {"play.start_paused", true},
                                                   {"play.clock_publish_frequency", 200.0},
                                                   {"play.disable_keyboard_controls", true}}));
    ReDAGOptions options;
    options.lockstep = true;
    ReDAGExecutor executor(options);
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
      for (std::size_t i = 0; i < kTopics; ++i) {
        if (heard.at(i) < recorded.at(i)) return false;
      }
      return true;
    }));
    executor.cancel();
    of_player.cancel();
    spinner.join();
    player_spinner.join();
    for (std::size_t i = 0; i < kTopics; ++i) EXPECT_EQ(heard.at(i), recorded.at(i)) << recording.topics()[i].name;
    EXPECT_TRUE(in_order);
    EXPECT_TRUE(in_recording);
    // 45 without stalls. rclcpp leaves out calls that come too late.
    EXPECT_GE(ticks, 3U);
    EXPECT_LE(ticks, static_cast<std::uint64_t>((end - kStart) / (20 * kMillisecond)) + 3);
  }
  rclcpp::shutdown();
}

}  // namespace
}  // namespace redag_rclcpp::lab
