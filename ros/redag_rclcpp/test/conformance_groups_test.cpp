// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: callback groups, and entities that come and go while the executor spins.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "conformance.hpp"
#include "rclcpp/rclcpp.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using test_msgs::msg::Empty;

// TimerQueue::add_timer_to_running_map() in a callback that was queued before the removal.
constexpr char kCrashes[] = "the EventsCBGExecutor can use a timer after its removal";

TYPED_TEST(Conformance, AnExclusiveGroupNeverOverlapsWithItself) {
  auto group = this->node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  std::atomic<int> inside{0};
  std::atomic<int> most{0};
  std::atomic<int> count{0};
  const auto body = [&] {
    const int now = ++inside;
    if (now > most) most = now;
    std::this_thread::sleep_for(1ms);
    --inside;
    ++count;
  };
  std::vector<rclcpp::TimerBase::SharedPtr> timers;
  for (int i = 0; i < 4; ++i) timers.push_back(this->node->create_wall_timer(2ms, body, group));
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return count >= 50; }));
  EXPECT_EQ(most, 1);
}

TYPED_TEST(Conformance, GroupsAndReentrantCallbacksRunInParallel) {
  if (!kParallel<TypeParam>) GTEST_SKIP() << "single-threaded";
  for (const bool reentrant : {false, true}) {
    if (reentrant && kCbg<TypeParam>) continue;  // runs one callback of any group at a time
    SCOPED_TRACE(reentrant ? "one reentrant group" : "two exclusive groups");
    auto other = std::make_shared<rclcpp::Node>("other");
    auto type = reentrant ? rclcpp::CallbackGroupType::Reentrant : rclcpp::CallbackGroupType::MutuallyExclusive;
    auto first = other->create_callback_group(type);
    auto second = reentrant ? first : other->create_callback_group(type);
    // Each callback waits for the other: both must run at the same time.
    std::atomic<int> inside{0};
    std::atomic<bool> met{false};
    const auto meet = [&] {
      ++inside;
      const auto end = steady_clock::now() + 2s;
      while (!met && steady_clock::now() < end) {
        if (inside >= 2) met = true;
        std::this_thread::sleep_for(100us);
      }
      --inside;
    };
    auto timer_1 = other->create_wall_timer(5ms, meet, first);
    auto timer_2 = other->create_wall_timer(5ms, meet, second);
    this->executor->add_node(other);
    {
      Spinner spinner(*this->executor);
      EXPECT_TRUE(eventually([&] { return met.load(); }));
    }
    this->executor->remove_node(other);
    this->renew_executor();
  }
}

TYPED_TEST(Conformance, AReentrantSubscriptionOverlapsWithItself) {
  if (kCbg<TypeParam>) GTEST_SKIP() << "it runs one callback of a group at a time, whatever the group";
  if (!kParallel<TypeParam>) GTEST_SKIP() << "single-threaded";
  auto group = this->node->create_callback_group(rclcpp::CallbackGroupType::Reentrant);
  std::atomic<int> inside{0};
  std::atomic<bool> met{false};
  rclcpp::SubscriptionOptions options;
  options.callback_group = group;
  auto subscription = this->node->template create_subscription<Empty>(
      "empty", rclcpp::QoS(10),
      [&](Empty::ConstSharedPtr) {
        ++inside;
        const auto end = steady_clock::now() + 2s;
        while (!met && steady_clock::now() < end) {
          if (inside >= 2) met = true;
          std::this_thread::sleep_for(100us);
        }
        --inside;
      },
      options);
  auto publisher = this->node->template create_publisher<Empty>("empty", rclcpp::QoS(10));
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  for (int i = 0; i < 4; ++i) publisher->publish(Empty());
  EXPECT_TRUE(eventually([&] { return met.load(); }));
}

TYPED_TEST(Conformance, EntitiesAndGroupsCreatedWhileSpinningAreServed) {
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  std::atomic<int> first{0};
  std::atomic<int> second{0};
  std::atomic<int> third{0};
  std::atomic<int> received{0};
  rclcpp::TimerBase::SharedPtr from_callback;
  std::mutex mutex;
  auto timer = this->node->create_wall_timer(2ms, [&] {
    ++first;
    const std::lock_guard guard(mutex);
    if (!from_callback) from_callback = this->node->create_wall_timer(2ms, [&] { ++second; });
  });
  EXPECT_TRUE(eventually([&] { return first > 2 && second > 2; }));
  auto group = this->node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  auto in_group = this->node->create_wall_timer(
      2ms, [&] { ++third; }, group);
  auto subscription = this->node->template create_subscription<Empty>("late", rclcpp::QoS(10),
                                                                      [&](Empty::ConstSharedPtr) { ++received; });
  auto publisher = this->node->template create_publisher<Empty>("late", rclcpp::QoS(10));
  EXPECT_TRUE(eventually([&] {
    publisher->publish(Empty());
    return third > 2 && received > 2;
  }));
  // Humble's rmw_fastrtps crashes if rclcpp's own executors wait for a subscription that is being destroyed.
  if (!kOurs<TypeParam>) spinner.stop();
}

TYPED_TEST(Conformance, AManuallyAddedGroupIsServedUntilItIsRemoved) {
  if (kCbg<TypeParam>) GTEST_SKIP() << kCrashes;
  auto group = this->node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false);
  std::atomic<int> count{0};
  auto timer = this->node->create_wall_timer(
      2ms, [&] { ++count; }, group);
  Spinner spinner(*this->executor);
  this->executor->add_callback_group(group, this->node->get_node_base_interface());
  EXPECT_TRUE(eventually([&] { return count >= 3; }));
  this->executor->remove_callback_group(group);
  std::this_thread::sleep_for(30ms);
  const int removed = count;
  std::this_thread::sleep_for(30ms);
  EXPECT_EQ(count, removed);
}

TYPED_TEST(Conformance, ARemovedNodeRunsNoMoreAndCanBeAddedAgain) {
  if (kCbg<TypeParam>) GTEST_SKIP() << kCrashes;
  std::atomic<int> count{0};
  auto timer = this->node->create_wall_timer(1ms, [&] { ++count; });
  Spinner spinner(*this->executor);
  for (int round = 0; round < 5; ++round) {
    const int before = count;
    this->executor->add_node(this->node);
    EXPECT_TRUE(eventually([&] { return count > before + 2; })) << round;
    this->executor->remove_node(this->node);
    std::this_thread::sleep_for(20ms);
    const int removed = count;
    std::this_thread::sleep_for(10ms);
    EXPECT_EQ(count, removed) << round;
  }
}

TYPED_TEST(Conformance, ANodeCanBeDestroyedWhileItsMessagesAreQueued) {
  if (kCbg<TypeParam>) GTEST_SKIP() << kCrashes;
  Spinner spinner(*this->executor);
  auto publisher = this->node->template create_publisher<Empty>("empty", rclcpp::QoS(100));
  this->executor->add_node(this->node);
  for (int round = 0; round < 10; ++round) {
    std::atomic<int> count{0};
    auto temporary = std::make_shared<rclcpp::Node>("temporary");
    auto subscription = temporary->create_subscription<Empty>("empty", rclcpp::QoS(100), [&](Empty::ConstSharedPtr) {
      ++count;
      std::this_thread::sleep_for(1ms);
    });
    auto timer = temporary->create_wall_timer(1ms, [&] { ++count; });
    this->executor->add_node(temporary);
    for (int i = 0; i < 20; ++i) publisher->publish(Empty());
    EXPECT_TRUE(eventually([&] { return count > 0; })) << round;
    this->executor->remove_node(temporary);
    // Lets a running callback end first.
    std::weak_ptr<rclcpp::Node> weak = temporary;
    std::this_thread::sleep_for(5ms);
    subscription.reset();
    timer.reset();
    temporary.reset();
    EXPECT_TRUE(eventually([&] { return weak.expired(); })) << round;
    std::this_thread::sleep_for(5ms);
  }
}

}  // namespace
}  // namespace redag_rclcpp
