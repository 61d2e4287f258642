// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: problems that users reported of rclcpp's executors, each with the number of the report. Where an
// executor of rclcpp still has the problem, its test is skipped and names it.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <thread>
#include <type_traits>

#include "conformance.hpp"
#include "rclcpp/rclcpp.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/empty.hpp"
#include "test_msgs/srv/empty.hpp"

namespace {

/// Seconds that this program adds to the time of day. Setting the machine's clock would disturb other programs.
std::atomic<time_t> clock_step{0};

}  // namespace

// Takes the place of glibc's function for this program and all its libraries.
extern "C" int clock_gettime(clockid_t clock, timespec *now) noexcept {
  const auto result = static_cast<int>(syscall(SYS_clock_gettime, clock, now));
  if (result == 0 && clock == CLOCK_REALTIME) now->tv_sec += clock_step;
  return result;
}

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using test_msgs::msg::Empty;

template <class T>
constexpr bool kMultiThreaded = std::is_same_v<T, rclcpp::executors::MultiThreadedExecutor>;

// ros2/rclcpp#2645 and #2912: two callbacks of one group that are always ready.
TYPED_TEST(Conformance, CallbacksOfAGroupTakeTurns) {
  if (kMultiThreaded<TypeParam>) GTEST_SKIP() << "one of them never runs: ros2/rclcpp#2645";
  std::atomic<int> first{0};
  std::atomic<int> second{0};
  const auto count_slowly = [](std::atomic<int> &count) {
    return [&count] {
      ++count;
      std::this_thread::sleep_for(4ms);
    };
  };
  auto timer = this->node->create_wall_timer(2ms, count_slowly(first));
  auto other = this->node->create_wall_timer(2ms, count_slowly(second));
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return first >= 20 && second >= 20; })) << first << " and " << second;
  spinner.stop();
  if (kOurs<TypeParam>) {
    EXPECT_LE(std::abs(first - second), 2);
  }
}

// ros2/rclcpp#2803: a timer of no period that is made in a callback, and dropped in its own.
TYPED_TEST(Conformance, OneShotTimersMadeInACallbackRun) {
  if (kEvents<TypeParam>) GTEST_SKIP() << "one is lost now and then: ros2/rclcpp#2803";
  std::atomic<int> shots{0};
  rclcpp::TimerBase::SharedPtr one_shot;
  auto timer = this->node->create_wall_timer(4ms, [&] {
    std::this_thread::sleep_for(3ms);
    if (one_shot) return;
    one_shot = this->node->create_wall_timer(0s, [&] {
      ++shots;
      one_shot.reset();
    });
  });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return shots >= 50; })) << shots;
}

// ros2/rclcpp#3201: programs that know the executor only as a rclcpp::Executor.
TYPED_TEST(Conformance, AFutureEndsTheSpinOfTheBaseClass) {
  if (kCbg<TypeParam>) GTEST_SKIP() << "it hangs: ros2/rclcpp#3201";
  using Service = test_msgs::srv::Empty;
  auto service = this->node->template create_service<Service>(
      "service", [](Service::Request::ConstSharedPtr, Service::Response::SharedPtr) {});
  auto client = this->node->template create_client<Service>("service");
  this->executor->add_node(this->node);
  ASSERT_TRUE(client->wait_for_service(kLimit));
  rclcpp::Executor &base = *this->executor;
  for (int i = 0; i < 5; ++i) {
    auto response = client->async_send_request(std::make_shared<Service::Request>());
    EXPECT_EQ(base.spin_until_future_complete(response, kLimit), rclcpp::FutureReturnCode::SUCCESS);
  }
}

// ros2/ros2#1080: the time of day is set while timers run and messages are sent.
TYPED_TEST(Conformance, StepsOfTheClockStopNoWallTimerAndNoMessage) {
  if (!kOurs<TypeParam>) GTEST_SKIP() << "with Cyclone DDS, two of rclcpp's executors stood still";
  std::atomic<int> expiries{0};
  std::atomic<int> messages{0};
  auto subscription = this->node->template create_subscription<Empty>("empty", rclcpp::QoS(10),
                                                                      [&](Empty::ConstSharedPtr) { ++messages; });
  auto publisher = this->node->template create_publisher<Empty>("empty", rclcpp::QoS(10));
  auto timer = this->node->create_wall_timer(2ms, [&] { ++expiries; });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  for (const time_t step : {3600, -3600, 86'400, 0}) {
    SCOPED_TRACE(step);
    clock_step = step;
    const int expiries_before = expiries;
    const int messages_before = messages;
    publisher->publish(Empty());
    EXPECT_TRUE(eventually([&] { return expiries >= expiries_before + 5 && messages > messages_before; }));
  }
}

// ros2/ros2#1081: the time of day was an hour back for a while. Timers of a node's clock go on when it is right again.
TYPED_TEST(Conformance, TimersOfANodesClockGoOnAfterItWasWrong) {
  if (!kOurs<TypeParam>) GTEST_SKIP() << "about what ReDAGExecutor promises";
  std::atomic<int> expiries{0};
  auto timer = rclcpp::create_timer(this->node, this->node->get_clock(), rclcpp::Duration(10ms), [&] { ++expiries; });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return expiries >= 5; }));
  clock_step = -3600;
  std::this_thread::sleep_for(300ms);
  clock_step = 0;
  EXPECT_TRUE(eventually([&, before = expiries.load()] { return expiries >= before + 5; }));
}

// ros2/rclcpp#2402: a timer whose callback takes longer than its period must not stop what is more urgent.
TEST(ReportedProblems, ASlowTimerDoesNotStopMoreUrgentMessages) {
  rclcpp::init(0, nullptr);
  {
    auto node = std::make_shared<rclcpp::Node>("node");
    ReDAGOptions options;
    options.preemption = redag::PreemptionMode::None;
    options.workers = 1;
    options.default_period = 1ms;  // of the subscription
    ReDAGExecutor executor(options);
    std::atomic<int> messages{0};
    auto subscription =
        node->create_subscription<Empty>("empty", rclcpp::QoS(10), [&](Empty::ConstSharedPtr) { ++messages; });
    auto publisher = node->create_publisher<Empty>("empty", rclcpp::QoS(10));
    auto timer = node->create_wall_timer(2ms, [] { std::this_thread::sleep_for(5ms); });
    executor.add_node(node);
    Spinner spinner(executor);
    ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
    for (int i = 1; i <= 20; ++i) {
      publisher->publish(Empty());
      ASSERT_TRUE(eventually([&] { return messages == i; })) << i;
    }
  }
  rclcpp::shutdown();
}

}  // namespace
}  // namespace redag_rclcpp
