// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests priorities that the middleware gives its threads by its own configuration (config/middleware), alone and beside
// 'raise_middleware'. A program of its own, because a middleware reads its configuration once.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "mode_test.hpp"
#include "rcl/context.h"
#include "redag/live/middleware_names.hpp"
#include "redag/threads/threads.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/basic_types.hpp"
#include "watch/middleware_threads.hpp"

namespace redag_rclcpp {
namespace {

using test_msgs::msg::BasicTypes;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr int kConfigured = 85;  // priority in the files

std::vector<MiddlewareThread> threads_that_deliver() {
  std::vector<MiddlewareThread> threads = find_middleware_threads().threads;
  threads.erase(std::remove_if(threads.begin(), threads.end(), [](const auto &thread) { return !thread.delivers; }),
                threads.end());
  return threads;
}

bool all_have(int priority) {
  const std::vector<MiddlewareThread> threads = threads_that_deliver();
  return std::all_of(threads.begin(), threads.end(), [&](const auto &thread) {
    return thread.priority == priority && sched_getscheduler(thread.id) == SCHED_FIFO;
  });
}

bool priorities_are_real() {
  bool real = false;
  std::thread([&] {
    const sched_param lowest{1};
    real = sched_setscheduler(0, SCHED_FIFO, &lowest) == 0 && sched_getscheduler(0) == SCHED_FIFO;
  }).join();
  return real;
}

class ConfiguredMiddleware : public ModeTest {
 protected:
  void SetUp() override {
    if (redag::runtime::available_fifo_priority(90) < 90) GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    if (!priorities_are_real()) GTEST_SKIP() << "threads have their priorities in name only (a build with sanitizers)";
    const std::string folder = MIDDLEWARE_CONFIG;
    setenv("CYCLONEDDS_URI", ("file://" + folder + "/cyclonedds.xml").c_str(), 1);
    setenv("FASTRTPS_DEFAULT_PROFILES_FILE", (folder + "/fastdds.xml").c_str(), 1);
    setenv("FASTDDS_DEFAULT_PROFILES_FILE", (folder + "/fastdds.xml").c_str(), 1);
    ModeTest::SetUp();
    name_ = rmw_name();
    const std::vector<MiddlewareThread> threads = threads_that_deliver();
    ASSERT_THAT(threads, Not(IsEmpty())) << name_;
    if (name_.rfind("rmw_fastrtps", 0) == 0 &&
        std::none_of(threads.begin(), threads.end(), [](const MiddlewareThread &thread) {
          return redag::live::is_middleware_thread_name(thread.name);
        })) {
      GTEST_SKIP() << "this Fast DDS has no configuration of threads";
    }
    if (name_.rfind("rmw_fastrtps", 0) != 0 && name_ != "rmw_cyclonedds_cpp") {
      GTEST_SKIP() << "no file for " << name_;
    }
  }

  [[nodiscard]] std::string rmw_name() const {
    const rclcpp::Context::SharedPtr context = node->get_node_base_interface()->get_context();
    return rcl_context_get_rmw_context(context->get_rcl_context().get())->implementation_identifier;
  }

  std::string name_;
};

TEST_P(ConfiguredMiddleware, NeedsNoRaising) {
  options.raise_middleware = false;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  {
    const Spinner spinner(executor);
    EXPECT_TRUE(eventually([] { return all_have(kConfigured); }));
  }
  EXPECT_TRUE(all_have(kConfigured));
  EXPECT_THAT(executor.warnings(), Not(Contains(HasSubstr(name_))));
}

TEST_P(ConfiguredMiddleware, IsRaisedWhileTheExecutorSpins) {
  const int raised = redag::runtime::probe_priority_band().timer;
  ASSERT_GT(raised, kConfigured);
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  {
    const Spinner spinner(executor);
    EXPECT_TRUE(eventually([&] { return all_have(raised); }));
  }
  EXPECT_TRUE(all_have(kConfigured));
}

/// Fast DDS with data sharing: messages of a fixed size lie in memory that publisher and subscription share.
class SharedData : public ConfiguredMiddleware {
 protected:
  void SetUp() override {
    ConfiguredMiddleware::SetUp();
    if (!IsSkipped() && name_.rfind("rmw_fastrtps", 0) != 0) GTEST_SKIP() << name_ << " has no such setting";
    if (IsSkipped() || HasFatalFailure()) return;
    // A participant reads the variable once. A Fast DDS that refuses the file could not make a node with it.
    ConfiguredMiddleware::TearDown();
    setenv("RMW_FASTRTPS_USE_QOS_FROM_XML", "1", 1);
    ConfiguredMiddleware::SetUp();
  }
  void TearDown() override {
    ConfiguredMiddleware::TearDown();
    unsetenv("RMW_FASTRTPS_USE_QOS_FROM_XML");
  }
};

TEST_P(SharedData, IsDeliveredByThreadsThatAreRaised) {
  const int raised = redag::runtime::probe_priority_band().timer;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  const auto plain = std::make_shared<rclcpp::Node>("plain");
  std::atomic<int> sum{0};
  const auto subscription = plain->create_subscription<BasicTypes>(
      "/shared", rclcpp::QoS(10), [&](BasicTypes::ConstSharedPtr message) { sum += message->int32_value; });
  const auto publisher = plain->create_publisher<BasicTypes>("/shared", rclcpp::QoS(10));
  executor.add_node(plain);
  const Spinner spinner(executor);
  EXPECT_TRUE(eventually([&] { return all_have(raised); }));
  const std::vector<MiddlewareThread> threads = threads_that_deliver();
  EXPECT_TRUE(std::any_of(threads.begin(), threads.end(),
                          [](const MiddlewareThread &thread) { return thread.name.rfind("dds.dsha.", 0) == 0; }));
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() == 1; }));
  BasicTypes message;
  message.int32_value = 2;
  for (int i = 0; i < 5; ++i) publisher->publish(message);
  EXPECT_TRUE(eventually([&] { return sum == 10; })) << sum;
}

// In the other modes workers have no priority.
INSTANTIATE_TEST_SUITE_P(Modes, SharedData, ::testing::Values(redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });
INSTANTIATE_TEST_SUITE_P(Modes, ConfiguredMiddleware, ::testing::Values(redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
