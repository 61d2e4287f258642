// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: subscriptions, services, actions, parameters, waitables and QoS events.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
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
#include "spinning.hpp"
#include "test_msgs/action/fibonacci.hpp"
#include "test_msgs/msg/empty.hpp"
#include "test_msgs/msg/strings.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using test_msgs::msg::Empty;
using test_msgs::msg::Strings;

TYPED_TEST(Conformance, EveryMessageArrivesInOrder) {
  for (const bool intra_process : {false, true}) {
    SCOPED_TRACE(intra_process ? "intra-process" : "through the middleware");
    auto other = std::make_shared<rclcpp::Node>("other", rclcpp::NodeOptions().use_intra_process_comms(intra_process));
    std::mutex mutex;
    std::vector<std::string> received;
    const rclcpp::QoS qos = rclcpp::QoS(1000).reliable();
    auto subscription = other->create_subscription<Strings>("strings", qos, [&](Strings::ConstSharedPtr message) {
      const std::lock_guard guard(mutex);
      received.push_back(message->string_value);
    });
    auto publisher = other->create_publisher<Strings>("strings", qos);
    this->executor->add_node(other);
    {
      Spinner spinner(*this->executor);
      ASSERT_TRUE(eventually([&] { return intra_process || publisher->get_subscription_count() > 0; }));
      std::vector<std::string> sent;
      for (int i = 0; i < 300; ++i) {
        auto message = std::make_unique<Strings>();
        message->string_value = std::to_string(i);
        sent.push_back(message->string_value);
        publisher->publish(std::move(message));
      }
      EXPECT_TRUE(eventually([&] {
        const std::lock_guard guard(mutex);
        return received.size() >= sent.size();
      }));
      spinner.stop();
      EXPECT_EQ(received, sent);
    }
    this->executor->remove_node(other);
  }
}

TYPED_TEST(Conformance, OverwrittenMessagesAreNotWaitedFor) {
  std::atomic<int> last{-1};
  std::atomic<int> count{0};
  auto subscription = this->node->template create_subscription<Strings>("strings", rclcpp::QoS(2),
                                                                        [&](Strings::ConstSharedPtr message) {
                                                                          ++count;
                                                                          last = std::stoi(message->string_value);
                                                                        });
  auto publisher = this->node->template create_publisher<Strings>("strings", rclcpp::QoS(2));
  this->executor->add_node(this->node);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  this->executor->spin_some();
  Strings message;
  for (int i = 0; i < 50; ++i) {
    message.string_value = std::to_string(i);
    publisher->publish(message);
  }
  std::this_thread::sleep_for(50ms);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return last == 49; }));
  std::this_thread::sleep_for(20ms);
  EXPECT_LE(count, 2);
  // Later messages still arrive.
  message.string_value = "100";
  publisher->publish(message);
  EXPECT_TRUE(eventually([&] { return last == 100; }));
}

TYPED_TEST(Conformance, SerializedMessages) {
  std::atomic<std::size_t> bytes{0};
  auto subscription = this->node->create_generic_subscription(
      "strings", "test_msgs/msg/Strings", rclcpp::QoS(10),
      [&](std::shared_ptr<rclcpp::SerializedMessage> message) { bytes = message->size(); });
  auto publisher = this->node->template create_publisher<Strings>("strings", rclcpp::QoS(10));
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  publisher->publish(Strings());
  EXPECT_TRUE(eventually([&] { return bytes > 0; }));
}

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
class TriggeredWaitable : public rclcpp::Waitable {
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
  std::shared_ptr<void> take_data_by_entity_id(std::size_t) override { return take_data(); }
#if RCLCPP_VERSION_MAJOR >= 28
  void add_to_wait_set(rcl_wait_set_t &set) override {
    rclcpp::detail::add_guard_condition_to_rcl_wait_set(set, condition_);
  }
  bool is_ready(const rcl_wait_set_t &) override { return pending_; }
  void execute(const std::shared_ptr<void> &) override { ++count; }
#else
  void add_to_wait_set(rcl_wait_set_t *set) override {
    rclcpp::detail::add_guard_condition_to_rcl_wait_set(*set, condition_);
  }
  bool is_ready(rcl_wait_set_t *) override { return pending_; }
  void execute(std::shared_ptr<void> &) override { ++count; }
#endif
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

}  // namespace
}  // namespace redag_rclcpp
