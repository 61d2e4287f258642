// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callbacks that await clocks, in each mode with one worker. And what the detector of
// deadlocks says of callbacks that wait without a worker.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "compat.hpp"
#include "mode_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/runtime/blocking.hpp"
#include "redag_rclcpp/coroutine.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "spinning.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using redag::Coroutine;
using EmptyService = test_msgs::srv::Empty;
using ::testing::SizeIs;

class AwaitTest : public ModeTest {
 protected:
  void TearDown() override {
    timers.clear();
    ModeTest::TearDown();
  }

  /// A timer of the node's default group whose first call runs `body`.
  void once(const std::function<Coroutine()> &body) {
    auto begun = std::make_shared<std::atomic<bool>>(false);
    timers.push_back(node->create_wall_timer(1ms, coroutine([body, begun]() -> Coroutine {
                                               if (!begun->exchange(true)) co_await body();
                                             })));
  }
  /// Spins until `condition` holds.
  void spin_until(const std::function<bool()> &condition) {
    ReDAGExecutor executor(options);
    executor.add_node(node);
    const Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually(condition));
  }

  std::vector<rclcpp::TimerBase::SharedPtr> timers;
};

const auto kModes =
    ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative, redag::PreemptionMode::Os);
std::string name_of(const ::testing::TestParamInfo<redag::PreemptionMode> &mode) { return to_string(mode.param); }

INSTANTIATE_TEST_SUITE_P(Modes, AwaitTest, kModes, name_of);

// ---- clocks ----

TEST_P(AwaitTest, AClockOfTheSystem) {
  std::atomic<int> woken{0};
  once([&]() -> Coroutine {
    for (const rcl_clock_type_t type : {RCL_STEADY_TIME, RCL_SYSTEM_TIME, RCL_ROS_TIME}) {
      const auto clock = std::make_shared<rclcpp::Clock>(type);
      const rclcpp::Time until = clock->now() + rclcpp::Duration(5ms);
      co_await sleep_until(clock, until);
      EXPECT_GE(clock->now(), until);
      co_await sleep_until(clock, until);  // has passed
      co_await sleep_for(clock, rclcpp::Duration(1ms));
      ++woken;
    }
  });
  spin_until([&] { return woken == 3; });
  const auto clock = std::make_shared<rclcpp::Clock>(RCL_STEADY_TIME);
  EXPECT_THROW((void)sleep_until(clock, rclcpp::Clock(RCL_ROS_TIME).now()), std::invalid_argument);
}

// Nothing but /clock moves the time.
TEST_P(AwaitTest, AClockOfASimulation) {
  node.reset();
  rclcpp::NodeOptions simulated;
  simulated.append_parameter_override("use_sim_time", true);
  node = std::make_shared<rclcpp::Node>("node", simulated);
  const auto simulation = std::make_shared<rclcpp::Node>("simulation");
  const auto out = simulation->create_publisher<rosgraph_msgs::msg::Clock>("/clock", rclcpp::ClockQoS());
  const auto show = [&](int seconds) {
    rosgraph_msgs::msg::Clock message;
    message.clock.sec = seconds;
    out->publish(message);
    EXPECT_TRUE(eventually([&] { return node->now().nanoseconds() == seconds * redag::kSecond; },
                           [&] {
                             out->publish(message);
                             std::this_thread::sleep_for(1ms);
                           }));
  };
  show(100);
  std::atomic<bool> waits{false};
  std::atomic<bool> woken{false};
  once([&]() -> Coroutine {
    const auto end = node->now() + rclcpp::Duration(10s);
    waits = true;
    co_await sleep_for(node->get_clock(), rclcpp::Duration(10s));
    EXPECT_GE(node->now(), end);
    woken = true;
  });
  ReDAGExecutor executor(options);
  executor.add_node(node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return waits.load(); }));
  for (const int seconds : {109, 50, 109}) {  // it goes back once
    show(seconds);
    EXPECT_FALSE(woken);
  }
  show(110);
  EXPECT_TRUE(eventually([&] { return woken.load(); }));
}

TEST_P(AwaitTest, CancelEndsASleepOfASimulatedClock) {
  const auto clock = std::make_shared<rclcpp::Clock>(RCL_ROS_TIME);
  {
    const std::lock_guard guard(clock->get_clock_mutex());
    ASSERT_EQ(rcl_enable_ros_time_override(clock->get_clock_handle()), RCL_RET_OK);
  }
  std::atomic<bool> waits{false};
  std::atomic<bool> went_on{false};
  once([&]() -> Coroutine {
    waits = true;
    co_await sleep_for(clock, rclcpp::Duration(1s));
    went_on = true;
  });
  spin_until([&] { return waits.load(); });
  EXPECT_FALSE(went_on);
  const std::lock_guard guard(clock->get_clock_mutex());
  EXPECT_EQ(rcl_set_ros_time_override(clock->get_clock_handle(), 10 * redag::kSecond), RCL_RET_OK) << "none listens";
}

// ---- deadlocks ----

class BlockedTest : public AwaitTest {
 protected:
  void SetUp() override {
    AwaitTest::SetUp();
    if (IsSkipped()) return;
    server_node = std::make_shared<rclcpp::Node>("server");
    service = server_node->create_service<EmptyService>(
        "/map", [](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) {});
    client = node->create_client<EmptyService>("/map");  // in the group of the timer
    elsewhere = std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
    elsewhere->add_node(server_node);
    options.threads = options.workers + 16;
  }
  void TearDown() override {
    release = true;
    client.reset();
    elsewhere.reset();
    service.reset();
    server_node.reset();
    AwaitTest::TearDown();
  }

  /// Waits for a response until the test ends it.
  void call_and_block() {
    const auto future = client->async_send_request(std::make_shared<EmptyService::Request>()).share();
    while (!release && future.wait_for(20ms) != std::future_status::ready) {
    }
  }
  void expect_deadlock() {
    ASSERT_TRUE(client->wait_for_service(kLimit));
    const Spinner<rclcpp::executors::SingleThreadedExecutor> server_spinner(*elsewhere);
    ReDAGExecutor executor(options);
    executor.add_node(node);
    Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually([&] { return !executor.deadlocks().empty(); }));
    const std::vector<Deadlock> found = executor.deadlocks();
    release = true;
    ASSERT_THAT(found, SizeIs(1));
    EXPECT_EQ(found[0].waiting, "/node timer 1 ms (0)");
    EXPECT_EQ(found[0].blocked, "/node client /map");
    EXPECT_EQ(found[0].resource, "the default callback group of /node");
    EXPECT_TRUE(found[0].certain);
    EXPECT_TRUE(eventually([&] { return executor.deadlocks().at(0).ended != redag::kNever; }));
    spinner.stop();
  }

  std::atomic<bool> release{false};
  std::unique_ptr<rclcpp::executors::SingleThreadedExecutor> elsewhere;
  rclcpp::Node::SharedPtr server_node;
  rclcpp::Service<EmptyService>::SharedPtr service;
  rclcpp::Client<EmptyService>::SharedPtr client;
};

INSTANTIATE_TEST_SUITE_P(Modes, BlockedTest, kModes, name_of);

TEST_P(BlockedTest, AFutureInACoroutineIsNamed) {
  once([&]() -> Coroutine {
    co_await redag::sleep_for(1ms);
    call_and_block();
  });
  expect_deadlock();
}

TEST_P(BlockedTest, AFutureInAScopeThatLendsTheWorkerIsNamed) {
  once([&]() -> Coroutine {
    const redag::Blocking scope;
    EXPECT_TRUE(scope.lends());
    call_and_block();
    co_return;
  });
  expect_deadlock();
}

// Both callbacks wait for longer than a deadlock needs to be named, while a response waits for their group.
TEST_P(BlockedTest, ACallbackThatAwaitsIsNotNamed) {
  const auto slow = server_node->create_service<EmptyService>(
      "/slow",
      [](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) { std::this_thread::sleep_for(1500ms); },
      compat::services_qos(), server_node->get_node_base_interface()->get_default_callback_group());
  const auto slow_client = node->create_client<EmptyService>("/slow");
  const auto other_client = node->create_client<EmptyService>("/map", compat::services_qos(), new_group());
  std::atomic<int> done{0};
  once([&]() -> Coroutine {
    client->async_send_request(std::make_shared<EmptyService::Request>());
    (void)co_await call(slow_client, std::make_shared<EmptyService::Request>());
    ++done;
  });
  // Its worker is lent: another one takes the response.
  auto blocked = std::make_shared<std::atomic<bool>>(false);
  timers.push_back(node->create_wall_timer(
      1ms,
      [&, blocked] {
        if (blocked->exchange(true)) return;
        const redag::Blocking scope;
        other_client->async_send_request(std::make_shared<EmptyService::Request>()).get();
        ++done;
      },
      new_group()));
  ASSERT_TRUE(client->wait_for_service(kLimit));
  ASSERT_TRUE(slow_client->wait_for_service(kLimit));
  const Spinner<rclcpp::executors::SingleThreadedExecutor> server_spinner(*elsewhere);
  ReDAGExecutor executor(options);
  executor.add_node(node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return done == 2; }));
  for (const Deadlock &deadlock : executor.deadlocks()) ADD_FAILURE() << deadlock.text;
}

}  // namespace
}  // namespace redag_rclcpp
