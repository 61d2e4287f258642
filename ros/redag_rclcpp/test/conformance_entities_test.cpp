// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: services, actions, parameters, waitables and QoS events. conformance_messages_test.cpp has messages.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "conformance.hpp"
#include "rclcpp/detail/add_guard_condition_to_rcl_wait_set.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"
#include "redag_rclcpp/any_waitable.hpp"
#include "spinning.hpp"
#include "test_msgs/action/fibonacci.hpp"
#include "test_msgs/msg/empty.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using test_msgs::msg::Empty;
using ::testing::HasSubstr;
using ::testing::Not;

TYPED_TEST(Conformance, ServiceAndClientOnOneExecutor) {
  auto service = this->node->template create_service<test_msgs::srv::Empty>(
      "service", [](test_msgs::srv::Empty::Request::SharedPtr, test_msgs::srv::Empty::Response::SharedPtr) {});
  auto client = this->node->template create_client<test_msgs::srv::Empty>("service");
  this->executor->add_node(this->node);
  ASSERT_TRUE(client->wait_for_service(kLimit));
  for (int i = 0; i < 10; ++i) {
    auto response = client->async_send_request(std::make_shared<test_msgs::srv::Empty::Request>());
    ASSERT_EQ(this->executor->spin_until_future_complete(response, kLimit), rclcpp::FutureReturnCode::SUCCESS);
  }
  Spinner spinner(*this->executor);
  for (int i = 0; i < 10; ++i) {
    auto response = client->async_send_request(std::make_shared<test_msgs::srv::Empty::Request>());
    ASSERT_EQ(response.wait_for(kLimit), std::future_status::ready);
  }
}

TYPED_TEST(Conformance, ActionsGiveFeedbackAndResults) {
  if (kCbg<TypeParam>) GTEST_SKIP() << "the EventsCBGExecutor does not deliver every result";
  using Fibonacci = test_msgs::action::Fibonacci;
  using Handle = rclcpp_action::ServerGoalHandle<Fibonacci>;
  std::vector<std::thread> threads;
  std::atomic<int> feedback{0};
  std::atomic<int> results{0};
  auto server = rclcpp_action::create_server<Fibonacci>(
      this->node, "fibonacci",
      [](const rclcpp_action::GoalUUID &, std::shared_ptr<const Fibonacci::Goal>) {
        return rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE;
      },
      [](std::shared_ptr<Handle>) { return rclcpp_action::CancelResponse::ACCEPT; },
      [&](std::shared_ptr<Handle> handle) {
        threads.emplace_back([&feedback, handle] {
          // A client ignores feedback that arrives before it knows that its goal was accepted.
          eventually([&] { return feedback > 0; },
                     [&] {
                       handle->publish_feedback(std::make_shared<Fibonacci::Feedback>());
                       std::this_thread::sleep_for(5ms);
                     });
          handle->succeed(std::make_shared<Fibonacci::Result>());
        });
      });
  auto client = rclcpp_action::create_client<Fibonacci>(this->node, "fibonacci");
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(client->wait_for_action_server(kLimit));
  typename rclcpp_action::Client<Fibonacci>::SendGoalOptions options;
  options.feedback_callback = [&](auto, auto) { ++feedback; };
  options.result_callback = [&](auto) { ++results; };
  for (int i = 0; i < 5; ++i) {
    auto goal = client->async_send_goal(Fibonacci::Goal(), options);
    ASSERT_EQ(goal.wait_for(kLimit), std::future_status::ready);
    ASSERT_NE(goal.get(), nullptr);
  }
  EXPECT_TRUE(eventually([&] { return results == 5; }));
  EXPECT_GT(feedback, 0);
  spinner.stop();
  for (auto &thread : threads) thread.join();
}

TYPED_TEST(Conformance, ExpiredGoalsAreForgotten) {
  if (kEvents<TypeParam> || kCbg<TypeParam>) GTEST_SKIP() << "depends on the patch level (rclcpp issue 2661)";
  using Fibonacci = test_msgs::action::Fibonacci;
  using Handle = rclcpp_action::ServerGoalHandle<Fibonacci>;
  rcl_action_server_options_t server_options = rcl_action_server_get_default_options();
  server_options.result_timeout.nanoseconds = 20'000'000;
  std::weak_ptr<Handle> weak;
  auto server = rclcpp_action::create_server<Fibonacci>(
      this->node, "fibonacci",
      [](const rclcpp_action::GoalUUID &, std::shared_ptr<const Fibonacci::Goal>) {
        return rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE;
      },
      [](std::shared_ptr<Handle>) { return rclcpp_action::CancelResponse::ACCEPT; },
      [&](std::shared_ptr<Handle> handle) { handle->succeed(std::make_shared<Fibonacci::Result>()); }, server_options);
  auto client = rclcpp_action::create_client<Fibonacci>(this->node, "fibonacci");
  auto sender = this->node->template create_client<Fibonacci::Impl::GetResultService>("fibonacci/_action/get_result");
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(client->wait_for_action_server(kLimit));
  auto goal = client->async_send_goal(Fibonacci::Goal());
  ASSERT_EQ(goal.wait_for(kLimit), std::future_status::ready);
  auto request = std::make_shared<Fibonacci::Impl::GetResultService::Request>();
  request->goal_id.uuid = goal.get()->get_goal_id();
  EXPECT_TRUE(eventually([&] {
    auto response = sender->async_send_request(request);
    if (response.wait_for(kLimit) != std::future_status::ready) return false;
    return response.get()->status == action_msgs::msg::GoalStatus::STATUS_UNKNOWN;
  }));
}

TYPED_TEST(Conformance, ParametersAndLifecycle) {
  auto lifecycle = std::make_shared<rclcpp_lifecycle::LifecycleNode>("lifecycle");
  this->node->declare_parameter("value", 1);
  this->executor->add_node(this->node);
  this->executor->add_node(lifecycle->get_node_base_interface());
  Spinner spinner(*this->executor);
  auto asking = std::make_shared<rclcpp::Node>("asking");
  auto parameters = std::make_shared<rclcpp::SyncParametersClient>(asking, "node");
  ASSERT_TRUE(parameters->wait_for_service(kLimit));
  EXPECT_TRUE(parameters->set_parameters({rclcpp::Parameter("value", 7)}).at(0).successful);
  EXPECT_EQ(parameters->get_parameter("value", 0), 7);
  lifecycle->configure();
  lifecycle->activate();
  EXPECT_EQ(lifecycle->get_current_state().label(), "active");
}

/// Ready from a trigger until data is taken, like rclcpp's own waitables. An executor may ask and then not take it,
/// because the group is busy. The constructor says whether it has a hook.
class TriggeredWaitable : public AnyWaitable {
 public:
  explicit TriggeredWaitable(bool has_hook) : has_hook_(has_hook) {}

  std::size_t get_number_of_ready_guard_conditions() override { return 1; }
  void trigger() {
    pending_ = true;
    condition_.trigger();
  }
  std::shared_ptr<void> take_data() override {
    pending_ = false;
    return nullptr;
  }
  void fill(rcl_wait_set_t &set) override { rclcpp::detail::add_guard_condition_to_rcl_wait_set(set, condition_); }
  bool is_ready_in(const rcl_wait_set_t &) override { return pending_; }
  void run(const std::shared_ptr<void> &) override { ++count; }
  void set_on_ready_callback(std::function<void(std::size_t, int)> callback) override {
    if (!has_hook_) throw std::runtime_error("this waitable has no hook");
    condition_.set_on_trigger_callback([callback](std::size_t n) { callback(n, 0); });
  }
  void clear_on_ready_callback() override {
    if (has_hook_) condition_.set_on_trigger_callback(nullptr);
  }

  std::atomic<int> count{0};

 private:
  bool has_hook_;
  std::atomic<bool> pending_{false};
  rclcpp::GuardCondition condition_;
};

TYPED_TEST(Conformance, WaitablesWithAndWithoutHooks) {
  if (kCbg<TypeParam>) GTEST_SKIP() << "the EventsCBGExecutor does not execute these";
  for (const bool has_hook : {true, false}) {
    if (kEvents<TypeParam> && !has_hook) continue;
    SCOPED_TRACE(has_hook ? "with a hook" : "only for wait sets");
    auto other = std::make_shared<rclcpp::Node>("other");
    auto waitable = std::make_shared<TriggeredWaitable>(has_hook);
    other->get_node_waitables_interface()->add_waitable(waitable, nullptr);
    this->executor->add_node(other);
    {
      Spinner spinner(*this->executor);
      for (int i = 1; i <= 5; ++i) {
        waitable->trigger();
        EXPECT_TRUE(eventually([&] { return waitable->count >= i; })) << i;
      }
    }
    this->executor->remove_node(other);
    // The same with the functions that pull.
    this->executor->add_node(other);
    const int before = waitable->count;
    waitable->trigger();
    EXPECT_TRUE(eventually([&] {
      this->executor->spin_some();
      return waitable->count > before;
    }));
    this->executor->remove_node(other);
  }
}

/// A waitable that its own timer triggers.
class TimedWaitable final : public TriggeredWaitable {
 public:
  explicit TimedWaitable(rclcpp::Node &node)
      : TriggeredWaitable(true),
        timer_(std::make_shared<rclcpp::GenericTimer<std::function<void()>>>(
            node.get_clock(), 20ms, [this] { trigger(); }, node.get_node_base_interface()->get_context())) {}
  [[nodiscard]] std::vector<rclcpp::TimerBase::SharedPtr> own_timers() const override { return {timer_}; }

 private:
  rclcpp::TimerBase::SharedPtr timer_;
};

TYPED_TEST(Conformance, TimersOfWaitablesAreCalled) {
  if (!kWaitablesHaveTimers) GTEST_SKIP() << "waitables have timers since Kilted";
  if (kCbg<TypeParam>) GTEST_SKIP() << "the EventsCBGExecutor does not execute these";
  if (!kOurs<TypeParam> && !kEvents<TypeParam>) GTEST_SKIP() << "wait sets take the place of the hook";
  auto waitable = std::make_shared<TimedWaitable>(*this->node);
  this->node->get_node_waitables_interface()->add_waitable(waitable, nullptr);
  this->executor->add_node(this->node);
  {
    Spinner spinner(*this->executor);
    EXPECT_TRUE(eventually([&] { return waitable->count >= 5; }));
  }
  if constexpr (kOurs<TypeParam>) {
    // The timer is a callback of its own that no workload names.
    const auto timers = [&] {
      std::vector<std::string> names;
      for (const auto &callback : this->executor->stats()) {
        if (callback.task.find("waitable timer") != std::string::npos) names.push_back(callback.task);
      }
      return names;
    };
    EXPECT_EQ(timers(), std::vector<std::string>{"/node waitable timer 20 ms (0)"});
    for (const redag::Dag &dag : this->executor->learned().dags) {
      for (const redag::Task &task : dag.tasks) EXPECT_THAT(task.name, Not(HasSubstr("waitable timer")));
    }
    // It goes with the waitable.
    this->node->get_node_waitables_interface()->remove_waitable(waitable, nullptr);
    waitable.reset();
    Spinner spinner(*this->executor);
    this->node->create_callback_group(rclcpp::CallbackGroupType::Reentrant);  // lets the executor look
    EXPECT_TRUE(eventually([&] { return timers().empty(); }));
  }
}

TYPED_TEST(Conformance, QosEventsAreDelivered) {
  std::atomic<int> matched{0};
  rclcpp::SubscriptionOptions options;
  options.event_callbacks.deadline_callback = [&](rclcpp::QOSDeadlineRequestedInfo &) { ++matched; };
  const rclcpp::QoS qos = rclcpp::QoS(10).deadline(20ms);
  auto subscription = this->node->template create_subscription<Empty>(
      "events", qos, [](Empty::ConstSharedPtr) {}, options);
  auto publisher = this->node->template create_publisher<Empty>("events", qos);
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  publisher->publish(Empty());
  EXPECT_TRUE(eventually([&] { return matched > 0; }));
}

// Users may ask to be called when something arrives, and have an executor run the callbacks.
TYPED_TEST(Conformance, HooksOfUsersAreCalledAsWell) {
  if (kEvents<TypeParam> || kCbg<TypeParam>) GTEST_SKIP() << "this executor replaces them by its own";
  using test_msgs::srv::Empty;
  using Message = test_msgs::msg::Empty;
  std::atomic<std::size_t> messages{0};
  std::atomic<std::size_t> message_hooks{0};
  std::atomic<std::size_t> request_hooks{0};
  std::atomic<std::size_t> response_hooks{0};
  std::atomic<std::size_t> event_hooks{0};
  const auto counts = [](std::atomic<std::size_t> &hooks) { return [&hooks](std::size_t count) { hooks += count; }; };
  rclcpp::SubscriptionOptions options;
  options.event_callbacks.deadline_callback = [](rclcpp::QOSDeadlineRequestedInfo &) {};
  const rclcpp::QoS qos = rclcpp::QoS(10).deadline(20ms);
  auto subscription = this->node->template create_subscription<Message>(
      "topic", qos, [&](Message::ConstSharedPtr) { ++messages; }, options);
  subscription->set_on_new_message_callback(counts(message_hooks));
  subscription->set_on_new_qos_event_callback(counts(event_hooks), RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED);
  auto publisher = this->node->template create_publisher<Message>("topic", qos);
  auto service = this->node->template create_service<Empty>(
      "service", [](Empty::Request::ConstSharedPtr, Empty::Response::SharedPtr) {});
  service->set_on_new_request_callback(counts(request_hooks));
  auto client = this->node->template create_client<Empty>("service");
  client->set_on_new_response_callback(counts(response_hooks));

  this->executor->add_node(this->node);
  {
    Spinner spinner(*this->executor);
    ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0 && client->service_is_ready(); }));
    for (std::size_t i = 1; i <= 5; ++i) {
      publisher->publish(Message());
      EXPECT_TRUE(eventually([&] { return messages == i && message_hooks >= i; })) << messages << " " << message_hooks;
    }
    auto response = client->async_send_request(std::make_shared<Empty::Request>());
    EXPECT_EQ(response.wait_for(kLimit), std::future_status::ready);
    EXPECT_TRUE(eventually([&] { return request_hooks == 1 && response_hooks == 1 && event_hooks > 0; }));
  }
  // They outlive the executor's use of the entities.
  this->executor->remove_node(this->node);
  const std::size_t before = message_hooks;
  const std::size_t events_before = event_hooks;
  publisher->publish(Message());
  EXPECT_TRUE(eventually([&] { return message_hooks > before && event_hooks > events_before; }));
}

}  // namespace
}  // namespace redag_rclcpp
