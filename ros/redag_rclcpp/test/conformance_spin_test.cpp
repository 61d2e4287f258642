// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: timers, clocks, and the functions that spin.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include "conformance.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using test_msgs::msg::Empty;

TYPED_TEST(Conformance, TimersRunUntilCancelled) {
  std::atomic<int> count{0};
  auto timer = this->node->create_wall_timer(1ms, [&] { ++count; });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return count >= 20; }));
  spinner.stop();
  const int after = count;
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(count, after);
}

TYPED_TEST(Conformance, SpinsAgainAfterCancel) {
  // rclcpp's MultiThreadedExecutor may be cancelled between taking a callback and running it. It then returns without
  // releasing the callback's group, and the timer never runs again: execute_any_executable() returns early, then run()
  // resets any_exec.callback_group.
  if (kParallel<TypeParam> && !kOurs<TypeParam> && !kCbg<TypeParam>) {
    GTEST_SKIP() << "rclcpp's MultiThreadedExecutor can lose a group here";
  }
  std::atomic<int> count{0};
  auto timer = this->node->create_wall_timer(1ms, [&] { ++count; });
  this->executor->add_node(this->node);
  for (int round = 0; round < 5; ++round) {
    const int before = count;
    Spinner spinner(*this->executor);
    EXPECT_TRUE(eventually([&] { return count > before + 3; }));
  }
}

TYPED_TEST(Conformance, ShutdownEndsSpin) {
  if (kCbg<TypeParam>) GTEST_SKIP() << "it takes back its shutdown callback within it, for which Jazzy's Context waits";
  this->executor->add_node(this->node);
  std::thread thread([&] { this->executor->spin(); });
  EXPECT_TRUE(eventually([&] { return this->executor->is_spinning(); }));
  rclcpp::shutdown();
  thread.join();
}

TYPED_TEST(Conformance, ASecondSpinThrows) {
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_THROW(this->executor->spin(), std::runtime_error);
  EXPECT_THROW(this->executor->spin_some(), std::runtime_error);
  EXPECT_THROW(this->executor->spin_once(), std::runtime_error);
}

TYPED_TEST(Conformance, ACancelledTimerStopsAndAResetOneGoesOn) {
  std::atomic<int> count{0};
  auto timer = this->node->create_wall_timer(2ms, [&] { ++count; });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return count >= 3; }));
  timer->cancel();
  std::this_thread::sleep_for(20ms);
  const int cancelled = count;
  std::this_thread::sleep_for(30ms);
  EXPECT_EQ(count, cancelled);
  timer->reset();
  EXPECT_TRUE(eventually([&] { return count >= cancelled + 3; }));
}

TYPED_TEST(Conformance, ATimerThatCancelsItselfRunsOnce) {
  if (kEvents<TypeParam>) GTEST_SKIP() << "expiries that the EventsExecutor has queued run all the same (issue 2771)";
  std::atomic<int> count{0};
  rclcpp::TimerBase::SharedPtr timer;
  timer = this->node->create_wall_timer(2ms, [&] {
    ++count;
    timer->cancel();
  });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return count > 0; }));
  std::this_thread::sleep_for(30ms);
  EXPECT_EQ(count, 1);
}

TYPED_TEST(Conformance, AnOverrunningTimerDoesNotBurst) {
  if (kEvents<TypeParam>) GTEST_SKIP() << "the EventsExecutor catches up (rclcpp issue 2771)";
  std::atomic<int> count{0};
  auto timer = this->node->create_wall_timer(5ms, [&] {
    // One long run misses many periods. The missed calls must be dropped.
    if (++count == 1) std::this_thread::sleep_for(200ms);
  });
  this->executor->add_node(this->node);
  const auto start = steady_clock::now();
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return count >= 4; }));
  const auto elapsed = steady_clock::now() - start;
  // If the missed calls had been made up for, dozens would have run at once.
  EXPECT_LE(count, 1 + (elapsed - 200ms) / 5ms + 3);
}

TYPED_TEST(Conformance, SimulatedTimeMovesTimers) {
  if (kEvents<TypeParam>) GTEST_SKIP() << "the EventsExecutor does not support simulated time (rclcpp issue 2457)";
  rclcpp::NodeOptions options;
  options.parameter_overrides({{"use_sim_time", true}});
  auto simulated = std::make_shared<rclcpp::Node>("simulated", options);
  std::atomic<int> count{0};
  auto timer = rclcpp::create_timer(simulated, simulated->get_clock(), 100ms, [&] { ++count; });
  auto clock = this->node->template create_publisher<rosgraph_msgs::msg::Clock>("/clock", rclcpp::ClockQoS());
  this->executor->add_node(simulated);
  Spinner spinner(*this->executor);
  rosgraph_msgs::msg::Clock message;
  message.clock.sec = 100;
  const auto now_is = [&](std::int64_t ns) {
    return eventually([&] {
      clock->publish(message);
      return simulated->now().nanoseconds() == ns;
    });
  };
  ASSERT_TRUE(now_is(100'000'000'000));
  // Switching simulated time on may count as an expiry, at any later moment.
  int before = 0;
  EXPECT_TRUE(eventually([&] {
    before = count;
    std::this_thread::sleep_for(300ms);
    return count == before;
  })) << "time stands still";
  for (int step = 1; step <= 5; ++step) {
    message.clock.nanosec += 100'000'000;
    const int last = count;
    ASSERT_TRUE(now_is(message.clock.sec * 1'000'000'000LL + message.clock.nanosec));
    EXPECT_TRUE(eventually([&] { return count > last; })) << step;
  }
  EXPECT_LE(count, before + 6);
}

TYPED_TEST(Conformance, TimersGoOnWhenSimulatedTimeEnds) {
  if (kEvents<TypeParam>) GTEST_SKIP() << "the EventsExecutor does not support simulated time (rclcpp issue 2457)";
  if (kCbg<TypeParam>) GTEST_SKIP() << "the EventsCBGExecutor's timers do not go on when simulated time returns";
  rclcpp::NodeOptions options;
  options.parameter_overrides({{"use_sim_time", true}});
  auto simulated = std::make_shared<rclcpp::Node>("simulated", options);
  std::atomic<int> count{0};
  auto timer = rclcpp::create_timer(simulated, simulated->get_clock(), 20ms, [&] { ++count; });
  auto clock = this->node->template create_publisher<rosgraph_msgs::msg::Clock>("/clock", rclcpp::ClockQoS());
  this->executor->add_node(simulated);
  Spinner spinner(*this->executor);
  rosgraph_msgs::msg::Clock message;
  message.clock.sec = 100;
  const auto moves = [&] {
    const int before = count;
    return eventually([&] {
      message.clock.nanosec = (message.clock.nanosec + 10'000'000) % 1'000'000'000;
      if (message.clock.nanosec == 0) ++message.clock.sec;
      clock->publish(message);
      return count >= before + 3;
    });
  };
  // rclcpp 28.1.6 deadlocks if it ends simulated time while its own thread receives a message on /clock: it joins this
  // thread with a lock that the thread needs (time_source.cpp, on_parameter_event() and the callback of /clock).
  const auto is_received = [&] {
    const std::int64_t last = message.clock.sec * 1'000'000'000LL + message.clock.nanosec;
    return eventually([&] { return simulated->get_clock()->now().nanoseconds() == last; });
  };
  ASSERT_TRUE(moves());
  for (int round = 0; round < 2; ++round) {
    ASSERT_TRUE(is_received());
    ASSERT_TRUE(simulated->set_parameter({"use_sim_time", false}).successful);
    const int before = count;
    EXPECT_TRUE(eventually([&] { return count >= before + 5; })) << "on the system's time";
    ASSERT_TRUE(simulated->set_parameter({"use_sim_time", true}).successful);
    ASSERT_TRUE(moves()) << "on simulated time again";
  }
}

TYPED_TEST(Conformance, AFutureOfAnotherThreadEndsTheSpin) {
  if (kCbg<TypeParam>) GTEST_SKIP() << "here the EventsCBGExecutor does not see a timer made after its node was added";
  this->executor->add_node(this->node);
  std::promise<void> promise;
  auto future = promise.get_future().share();
  std::thread other([&] {
    std::this_thread::sleep_for(50ms);
    promise.set_value();
  });
  // rclcpp's executors check the future only when something wakes them.
  rclcpp::TimerBase::SharedPtr waking;
  if (!kOurs<TypeParam>) waking = this->node->create_wall_timer(10ms, [] {});
  EXPECT_EQ(this->executor->spin_until_future_complete(future, kLimit), rclcpp::FutureReturnCode::SUCCESS);
  other.join();
}

TYPED_TEST(Conformance, SpinSomeRunsWhatIsReadyOnTheCallingThread) {
  std::vector<std::thread::id> threads;
  auto subscription = this->node->template create_subscription<Empty>(
      "empty", rclcpp::QoS(10), [&](Empty::ConstSharedPtr) { threads.push_back(std::this_thread::get_id()); });
  auto publisher = this->node->template create_publisher<Empty>("empty", rclcpp::QoS(10));
  this->executor->add_node(this->node);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  this->executor->spin_some();
  EXPECT_TRUE(threads.empty());
  publisher->publish(Empty());
  EXPECT_TRUE(eventually([&] {
    this->executor->spin_some();
    return threads.size() == 1;
  }));
  if (!threads.empty()) {
    EXPECT_EQ(threads[0], std::this_thread::get_id());
  }
}

TYPED_TEST(Conformance, SpinAllRunsUntilNothingIsLeft) {
  int count = 0;
  auto subscription = this->node->template create_subscription<Empty>("empty", rclcpp::QoS(100),
                                                                      [&](Empty::ConstSharedPtr) { ++count; });
  auto publisher = this->node->template create_publisher<Empty>("empty", rclcpp::QoS(100));
  this->executor->add_node(this->node);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  for (int i = 0; i < 30; ++i) publisher->publish(Empty());
  std::this_thread::sleep_for(50ms);
  this->executor->spin_all(kLimit);
  EXPECT_EQ(count, 30);
}

// Programs and rclcpp's own tests compare the text.
TYPED_TEST(Conformance, SpinAllRefusesANegativeDuration) {
  if (kEvents<TypeParam> || kCbg<TypeParam>) GTEST_SKIP() << "it says something else";
  try {
    this->executor->spin_all(-1ns);
    ADD_FAILURE() << "it was taken";
  } catch (const std::invalid_argument &error) {
    EXPECT_STREQ(error.what(), "max_duration must be greater than or equal to 0");
  }
}

TYPED_TEST(Conformance, SpinOnceRunsOneAndTimesOut) {
  int count = 0;
  auto subscription = this->node->template create_subscription<Empty>("empty", rclcpp::QoS(100),
                                                                      [&](Empty::ConstSharedPtr) { ++count; });
  auto publisher = this->node->template create_publisher<Empty>("empty", rclcpp::QoS(100));
  this->executor->add_node(this->node);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  for (int i = 0; i < 3; ++i) publisher->publish(Empty());
  std::this_thread::sleep_for(20ms);
  for (int calls = 0; count < 3 && calls < 100; ++calls) {
    const int before = count;
    this->executor->spin_once(100ms);
    EXPECT_LE(count, before + 1);
  }
  EXPECT_EQ(count, 3);
  const auto start = steady_clock::now();
  this->executor->spin_once(30ms);
  this->executor->spin_once(0ms);
  EXPECT_GE(steady_clock::now() - start, 0ms);
  EXPECT_EQ(count, 3);
}

TYPED_TEST(Conformance, TheLongestDurationIsNoLimit) {
  if (!kOurs<TypeParam>) GTEST_SKIP() << "signed numbers overflow";
  int calls = 0;
  std::vector<rclcpp::TimerBase::SharedPtr> timers;
  const auto once = [&](std::chrono::milliseconds period) {
    timers.push_back(this->node->create_wall_timer(period, [&, at = timers.size()] {
      ++calls;
      timers[at]->cancel();
    }));
  };
  for (int i = 0; i < 5; ++i) once(1ms);
  this->executor->add_node(this->node);
  std::this_thread::sleep_for(5ms);
  this->executor->spin_some(std::chrono::nanoseconds::max());
  EXPECT_EQ(calls, 5);
  once(50ms);
  // What the cancelled timers had released takes a turn each.
  for (int turn = 0; turn < 20 && calls < 6; ++turn) this->executor->spin_once(std::chrono::nanoseconds::max());
  EXPECT_EQ(calls, 6) << "it did not wait";
}

}  // namespace
}  // namespace redag_rclcpp
