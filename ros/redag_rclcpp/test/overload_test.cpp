// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests ReDAGExecutor under overload: full queues, budgets, criticality.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <new>
#include <thread>
#include <utility>
#include <vector>

#include "mode_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/basic_types.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using test_msgs::msg::BasicTypes;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

using OverloadTest = ModeTest;

/// A subscription that receives numbered messages, in a callback group of its own.
class Numbers {
 public:
  Numbers(const rclcpp::Node::SharedPtr &node, const std::string &topic, bool in_process, std::size_t depth = 10)
      : group_(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive)) {
    rclcpp::SubscriptionOptions options;
    rclcpp::PublisherOptions publishing;
    options.callback_group = group_;
    options.use_intra_process_comm = publishing.use_intra_process_comm =
        in_process ? rclcpp::IntraProcessSetting::Enable : rclcpp::IntraProcessSetting::Disable;
    subscription_ = node->create_subscription<BasicTypes>(
        topic, rclcpp::QoS(depth),
        [this](BasicTypes::ConstSharedPtr message) {
          received.push_back(message->int32_value);
          use_processor(std::chrono::nanoseconds(execution));
        },
        options, std::make_shared<Messages>(before_next_take));
    publisher_ = node->create_publisher<BasicTypes>(topic, rclcpp::QoS(depth), publishing);
  }
  void publish(int number) {
    auto message = std::make_unique<BasicTypes>();
    message->int32_value = number;
    publisher_->publish(std::move(message));
  }

  std::vector<int> received;
  redag::Duration execution = 0;           // processor time of the callback
  std::function<void()> before_next_take;  // called when a message to take into is created; not within a process

 private:
  class Messages : public rclcpp::message_memory_strategy::MessageMemoryStrategy<BasicTypes> {
   public:
    explicit Messages(std::function<void()> &next) : next_(next) {}
    std::shared_ptr<BasicTypes> borrow_message() override {
      if (const auto meanwhile = std::exchange(next_, nullptr)) meanwhile();
      return MessageMemoryStrategy::borrow_message();
    }

   private:
    std::function<void()> &next_;
  };

  rclcpp::CallbackGroup::SharedPtr group_;
  rclcpp::Subscription<BasicTypes>::SharedPtr subscription_;
  rclcpp::Publisher<BasicTypes>::SharedPtr publisher_;
};

redag::sched::Accounting jobs_of(const ReDAGExecutor &executor, const std::string &task) {
  for (const CallbackStats &stats : executor.stats()) {
    if (stats.task == task) return stats.jobs;
  }
  ADD_FAILURE() << "no task " << task;
  return {};
}

constexpr const char *kOneSubscription = R"(
name: budgets
dags:
  - name: d
    tasks:
      - {name: a, period: 10ms, wcet: 1ms, budget: 1ms, on_budget: skip_next,
         callback: {node: /node, subscription: /numbers}}
)";

// ---- full queues ----

TEST_P(OverloadTest, OverwrittenMessagesAreCounted) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> count{0};
  auto subscription = node->create_subscription<Empty>("/x", rclcpp::QoS(3), [&](Empty::ConstSharedPtr) { ++count; });
  executor.add_node(node);
  auto to_x = node->create_publisher<Empty>("/x", rclcpp::QoS(3));
  for (int i = 0; i < 10; ++i) to_x->publish(Empty());
  executor.spin_all(kLimit);
  EXPECT_EQ(count, 3);
  CallbackStats stats;
  for (const CallbackStats &s : executor.stats()) {
    if (s.id.name == "/x") stats = s;
  }
  EXPECT_EQ(stats.jobs.released, 10U);
  EXPECT_EQ(stats.jobs.finished, 3U);
  EXPECT_EQ(stats.jobs.skipped, 7U);
}

// Messages arrive between the start of a job and its take. They overwrite the message that released the job.
TEST_P(OverloadTest, AJobTakesWhatHasOverwrittenItsMessage) {
  options.workload = valid(kOneSubscription);
  ReDAGExecutor executor(options);
  Numbers numbers(node, "/numbers", false, 3);
  executor.add_node(node);
  numbers.publish(1);
  numbers.before_next_take = [&] {
    for (int i = 2; i <= 5; ++i) numbers.publish(i);
  };
  executor.spin_all(kLimit);
  EXPECT_THAT(numbers.received, ElementsAre(3, 4, 5));
  const auto jobs = jobs_of(executor, "d.a");
  EXPECT_EQ(jobs.released, 5u);
  EXPECT_EQ(jobs.finished, 3u);
  EXPECT_EQ(jobs.skipped, 2u);
}

TEST_P(OverloadTest, ASkippedMessageThatIsOverwrittenIsNotDroppedTwice) {
  options.workload = valid(kOneSubscription);
  ReDAGExecutor executor(options);
  Numbers numbers(node, "/numbers", false, 3);
  executor.add_node(node);
  numbers.execution = 2 * redag::kMillisecond;  // more than its budget: the next job is skipped
  numbers.publish(1);
  executor.spin_some();
  numbers.execution = 0;
  numbers.publish(2);
  numbers.publish(3);
  numbers.before_next_take = [&] {
    for (int i = 4; i <= 5; ++i) numbers.publish(i);
  };
  executor.spin_all(kLimit);
  EXPECT_THAT(numbers.received, ElementsAre(1, 3, 4, 5));
  const auto jobs = jobs_of(executor, "d.a");
  EXPECT_EQ(jobs.released, 5u);
  EXPECT_EQ(jobs.finished, 4u);
  EXPECT_EQ(jobs.skipped, 1u);
}

TEST_P(OverloadTest, AfterATakeThatThrewNothingIsLeftBehind) {
  for (const std::size_t depth : {1u, 3u}) {
    SCOPED_TRACE(depth);
    ReDAGExecutor executor(options);
    Numbers numbers(node, "/numbers", false, depth);
    executor.add_node(node);
    numbers.publish(1);
    numbers.before_next_take = [] { throw std::bad_alloc(); };
    EXPECT_THROW(executor.spin_all(kLimit), std::bad_alloc);
    EXPECT_THAT(numbers.received, IsEmpty());
    numbers.publish(2);
    executor.spin_all(kLimit);
    if (depth == 1) {
      EXPECT_THAT(numbers.received, ElementsAre(2));
    } else {
      EXPECT_THAT(numbers.received, ElementsAre(1, 2));
    }
    executor.remove_node(node);
  }
}

// ---- budgets and criticality ----

TEST_P(OverloadTest, AfterASkippedReleaseTheNextMessageIsTaken) {
  options.workload = valid(kOneSubscription);
  for (const bool in_process : {true, false}) {
    SCOPED_TRACE(in_process);
    ReDAGExecutor executor(options);
    Numbers numbers(node, "/numbers", in_process);
    numbers.execution = 2 * redag::kMillisecond;
    executor.add_node(node);
    for (int i = 1; i <= 5; ++i) {
      numbers.publish(i);
      executor.spin_some();
    }
    EXPECT_THAT(numbers.received, ElementsAre(1, 3, 5));
    EXPECT_EQ(jobs_of(executor, "d.a").skipped, 2u);
    executor.remove_node(node);
  }
}

TEST_P(OverloadTest, AMessageBeyondMaxPendingIsDroppedAndTheNextOneTaken) {
  options.workload = valid(R"(
name: admission
dags:
  - name: d
    max_pending: 1
    tasks:
      - {name: a, period: 10ms, callback: {node: /node, subscription: /a}}
      - {name: b, period: 20ms, callback: {node: /node, subscription: /b}}
)");
  ReDAGExecutor executor(options);
  Numbers a(node, "/a", true);
  Numbers b(node, "/b", true);
  executor.add_node(node);
  a.publish(1);
  b.publish(1);
  executor.spin_some();
  b.publish(2);
  executor.spin_some();
  EXPECT_THAT(a.received, ElementsAre(1));
  EXPECT_THAT(b.received, ElementsAre(2));
  EXPECT_EQ(jobs_of(executor, "d.b").skipped, 1u);
}

constexpr const char *kTwoCriticalities = R"(
name: criticality
dags:
  - name: high
    criticality: high
    tasks:
      - {name: control, period: 10ms, wcet: 5ms, wcet_low: 1ms, callback: {node: /node, subscription: /control}}
  - name: low
    tasks:
      - {name: map, period: 100ms, wcet: 5ms, callback: {node: /node, subscription: /map}}
      - {name: ask, period: 100ms, wcet: 5ms, callback: {node: /node, service: /ask}}
)";

TEST_P(OverloadTest, HighModeDropsMessagesOfLowerCriticalityUntilItEnds) {
  options.workload = valid(kTwoCriticalities);
  for (const bool in_process : {true, false}) {
    SCOPED_TRACE(in_process);
    ReDAGExecutor executor(options);
    Numbers control(node, "/control", in_process);
    control.execution = 2 * redag::kMillisecond;
    Numbers map(node, "/map", in_process);
    executor.add_node(node);
    for (int i = 1; i <= 3; ++i) {
      if (i == 2) control.publish(i);  // HI mode begins, and ends because nothing else is in progress
      map.publish(i);
      executor.spin_some();
    }
    EXPECT_THAT(control.received, ElementsAre(2));
    EXPECT_THAT(map.received, ElementsAre(1, 3));
    EXPECT_EQ(jobs_of(executor, "low.map").skipped, 1u);
    executor.remove_node(node);
  }
}

TEST_P(OverloadTest, HighModeDelaysRequestsAndDropsNone) {
  options.workload = valid(kTwoCriticalities);
  ReDAGExecutor executor(options);
  Numbers control(node, "/control", true);
  control.execution = 2 * redag::kMillisecond;
  int asked = 0;
  const auto service = node->create_service<test_msgs::srv::Empty>(
      "/ask", [&](test_msgs::srv::Empty::Request::SharedPtr, test_msgs::srv::Empty::Response::SharedPtr) { ++asked; });
  const auto client = node->create_client<test_msgs::srv::Empty>("/ask");
  executor.add_node(node);
  ASSERT_TRUE(client->wait_for_service(10s));
  control.publish(1);
  auto answer = client->async_send_request(std::make_shared<test_msgs::srv::Empty::Request>());
  ASSERT_TRUE(eventually([&] { return jobs_of(executor, "low.ask").skipped > 0; },
                         [&] {
                           if (asked > 0) control.publish(1);
                           executor.spin_some();
                         }));
  EXPECT_EQ(executor.spin_until_future_complete(answer, 10s), rclcpp::FutureReturnCode::SUCCESS);
  EXPECT_EQ(asked, 1);
}

TEST_P(OverloadTest, LowerCriticalityGoesOnAfterHighModeOnWorkers) {
  options.workload = valid(kTwoCriticalities);
  ReDAGExecutor executor(options);
  Numbers control(node, "/control", false);
  control.execution = 2 * redag::kMillisecond;
  Numbers map(node, "/map", false);
  executor.add_node(node);
  std::uint64_t sent = 0;
  std::uint64_t rounds = 0;
  const auto all_ended = [&] {
    const auto controls = jobs_of(executor, "high.control");
    const auto maps = jobs_of(executor, "low.map");
    // Counts aborted jobs, too. With a full queue, a message can be overwritten and its successor taken before the
    // executor learns of it.
    return controls.finished + controls.skipped == rounds && maps.finished + maps.skipped + maps.aborted == sent;
  };
  {
    Spinner spinner(executor);
    ASSERT_TRUE(eventually([&] { return rounds >= 20 && jobs_of(executor, "low.map").skipped > 0; },
                           [&] {
                             control.publish(0);
                             ++rounds;
                             for (int i = 0; i < 3; ++i) map.publish(static_cast<int>(++sent));
                             std::this_thread::sleep_for(5ms);
                           }));
    ASSERT_TRUE(eventually(all_ended));
    // HI mode lasts while anything else is in progress, such as the node's own callbacks.
    const std::uint64_t before = jobs_of(executor, "low.map").finished;
    ASSERT_TRUE(eventually([&] { return jobs_of(executor, "low.map").finished > before; },
                           [&] {
                             map.publish(1'000'000);
                             ++sent;
                             std::this_thread::sleep_for(5ms);
                           }));
    ASSERT_TRUE(eventually(all_ended));
  }
  EXPECT_EQ(map.received.back(), 1'000'000);
}

INSTANTIATE_TEST_SUITE_P(Modes, OverloadTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
