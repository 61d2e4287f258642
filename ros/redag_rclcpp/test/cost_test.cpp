// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a short callback costs in system calls and clock readings. The callback publishes to itself, so that the
// executor is never idle. From some callback on, its thread has a stepped clock: all callbacks are short, whatever the
// machine does.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <atomic>
#include <memory>
#include <thread>

#include "mode_test.hpp"
#include "spinning.hpp"
#include "stepped_clock.hpp"
#include "system_calls.hpp"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define REDAG_SANITIZED 1
#else
#define REDAG_SANITIZED 0
#endif

namespace redag_rclcpp {
namespace {

using redag::testing::clock_readings;

struct Cost {
  std::uint64_t calls = 0;
  std::uint64_t asked = 0;  // for the thread's processor time
  std::uint64_t clocks = 0;
};

class CostTest : public ModeTest {
 protected:
  static constexpr int kWarm = 100;
  static constexpr int kCount = 1000;
  // After a callback in which its thread lost the processor, the next ones are measured exactly.
  static constexpr int kNowAndThen = kCount / 20;

  static Cost now(const redag::testing::SystemCalls &calls) {
    return {calls.count(), clock_readings.processor, clock_readings.monotonic};
  }

  /// Runs the callback, and returns what kCount calls of it cost. `count_calls`: system calls, too.
  Cost measure(redag::testing::SystemCalls &calls, bool count_calls) {
    Cost before;
    Cost after;
    std::atomic<int> called{0};
    std::atomic<bool> done{false};
    const auto out = publisher("ring");
    const auto in = subscribe("ring", [&] {
      redag::testing::step_clock(10);
      const int call = called++;
      if (call == kWarm && count_calls && !calls.count_this_thread()) {
        done = true;
        return;
      }
      if (call == 2 * kWarm) before = now(calls);
      if (call == 2 * kWarm + kCount) {
        after = now(calls);
        done = true;
        return;
      }
      out->publish(std::make_unique<Empty>());
    });
    ReDAGExecutor executor(options);
    executor.add_node(node);
    {
      const Spinner spinner(executor);
      out->publish(std::make_unique<Empty>());
      EXPECT_TRUE(eventually([&] { return done.load(); }));
    }
    return {after.calls - before.calls, after.asked - before.asked, after.clocks - before.clocks};
  }
};
INSTANTIATE_TEST_SUITE_P(Modes, CostTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &instance) { return std::string(to_string(instance.param)); });

// In each of these tests, the thread that looks for new entities may do something now and then.
TEST_P(CostTest, AShortCallbackMakesNoSystemCall) {
  if (REDAG_SANITIZED) GTEST_SKIP() << "sanitizers make system calls of their own";
  redag::testing::SystemCalls calls;
  const Cost cost = measure(calls, true);
  if (!calls.why().empty()) GTEST_SKIP() << "system calls CANNOT BE COUNTED here: " << calls.why();
  EXPECT_LE(cost.calls, kNowAndThen) << calls.list();
}

TEST_P(CostTest, AShortCallbackAsksForNoProcessorTime) {
  redag::testing::SystemCalls calls;
  const Cost cost = measure(calls, false);
  EXPECT_LE(cost.asked, kNowAndThen);
}

// One reading of the clock when the message arrives, and one when the callback ends.
TEST_P(CostTest, AShortCallbackReadsTheClockTwice) {
  redag::testing::SystemCalls calls;
  const Cost cost = measure(calls, false);
  EXPECT_LE(cost.clocks, 2u * kCount + kNowAndThen);
}

// The callback releases its next job before it ends. A second worker that is woken for each of them, and finds it
// taken, makes the ring several times slower.
TEST_P(CostTest, ASecondWorkerIsNotWokenForEachCallback) {
  constexpr int kCalls = 5000;
  const auto switches = [] {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    return usage.ru_nvcsw;
  };
  std::atomic<long> before{0};
  std::atomic<long> after{0};
  std::atomic<int> called{0};
  const auto out = publisher("ring");
  rclcpp::SubscriptionOptions reentrant;
  reentrant.callback_group = groups.emplace_back(node->create_callback_group(rclcpp::CallbackGroupType::Reentrant));
  const auto in = node->create_subscription<Empty>(
      "ring", rclcpp::QoS(10),
      [&](Empty::ConstSharedPtr) {
        const int call = called++;
        if (call == kWarm) before = switches();
        if (call == kWarm + kCalls) after = switches();
        if (call < kWarm + kCalls) out->publish(std::make_unique<Empty>());
      },
      reentrant);
  options.workers = 2;
  ReDAGExecutor executor(options);
  executor.add_node(node);
  {
    const Spinner spinner(executor);
    out->publish(std::make_unique<Empty>());
    ASSERT_TRUE(eventually([&] { return after.load() > 0; }));
  }
  EXPECT_LE(after - before, kCalls / 5);
}

}  // namespace
}  // namespace redag_rclcpp
