// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: messages that are copied, serialized, or lent by the middleware.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "conformance.hpp"
#include "rclcpp/rclcpp.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/basic_types.hpp"
#include "test_msgs/msg/strings.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using test_msgs::msg::BasicTypes;
using test_msgs::msg::Strings;

/// Lets subscriptions that are made meanwhile borrow messages, which rcl refuses by default since Iron. Fast DDS lends
/// messages of a fixed size; the tests' other middlewares do not.
class Loans {
 public:
  explicit Loans(bool allowed) { setenv(kVariable, allowed ? "0" : "1", 1); }
  ~Loans() { unsetenv(kVariable); }
  Loans(const Loans &) = delete;
  Loans &operator=(const Loans &) = delete;

 private:
  static constexpr const char *kVariable = "ROS_DISABLE_LOANED_MESSAGES";
};

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

// A middleware has few messages to lend: it must get each one back.
TYPED_TEST(Conformance, LoanedMessagesAreGivenBack) {
  const Loans allowed(true);
  std::atomic<std::int64_t> last{0};
  const rclcpp::QoS qos = rclcpp::QoS(5).reliable();
  auto subscription = this->node->template create_subscription<BasicTypes>(
      "basic", qos, [&](BasicTypes::ConstSharedPtr message) { last = message->int64_value; });
  auto publisher = this->node->template create_publisher<BasicTypes>("basic", qos);
  this->RecordProperty("lent", subscription->can_loan_messages() ? "yes" : "no, copied");
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
  for (std::int64_t i = 1; i <= 200; ++i) {
    if (publisher->can_loan_messages()) {
      auto message = publisher->borrow_loaned_message();
      message.get() = BasicTypes();
      message.get().int64_value = i;
      publisher->publish(std::move(message));
    } else {
      BasicTypes message;
      message.int64_value = i;
      publisher->publish(message);
    }
    ASSERT_TRUE(eventually([&] { return last == i; })) << last << " instead of " << i;
  }
}

// An executor that is told of no arrival, because it came earlier, has to look for messages, and to stop when there are
// none. Only ReDAGExecutor is held to this: some others lose such messages.
TYPED_TEST(Conformance, EarlierMessagesOfEachKindAreTakenOnce) {
  if (!kOurs<TypeParam>) GTEST_SKIP() << "a property of ReDAGExecutor";
  struct Kind {
    const char *name;
    bool loans;
    std::function<rclcpp::SubscriptionBase::SharedPtr(rclcpp::Node &, std::atomic<int> &)> subscribe;
  };
  const auto typed = [](rclcpp::Node &owner, std::atomic<int> &count) -> rclcpp::SubscriptionBase::SharedPtr {
    return owner.create_subscription<BasicTypes>("basic", rclcpp::QoS(10),
                                                 [&](BasicTypes::ConstSharedPtr) { ++count; });
  };
  const auto generic = [](rclcpp::Node &owner, std::atomic<int> &count) -> rclcpp::SubscriptionBase::SharedPtr {
    return owner.create_generic_subscription("basic", "test_msgs/msg/BasicTypes", rclcpp::QoS(10),
                                             [&](std::shared_ptr<rclcpp::SerializedMessage>) { ++count; });
  };
  for (const Kind &kind :
       {Kind{"copied", false, typed}, Kind{"serialized", false, generic}, Kind{"lent", true, typed}}) {
    SCOPED_TRACE(kind.name);
    const Loans loans(kind.loans);
    std::atomic<int> count{0};
    auto other = std::make_shared<rclcpp::Node>("other");
    auto subscription = kind.subscribe(*other, count);
    auto publisher = other->template create_publisher<BasicTypes>("basic", rclcpp::QoS(10));
    ASSERT_TRUE(eventually([&] { return publisher->get_subscription_count() > 0; }));
    {
      TypeParam first;
      first.add_node(other);
      for (int i = 0; i < 3; ++i) publisher->publish(BasicTypes());
      std::this_thread::sleep_for(20ms);
    }
    const auto start = std::chrono::steady_clock::now();
    TypeParam second;
    second.add_node(other);
    second.spin_all(kLimit);
    EXPECT_EQ(count, 3);
    EXPECT_LT(std::chrono::steady_clock::now() - start, kLimit) << "it took nothing again and again";
  }
}

}  // namespace
}  // namespace redag_rclcpp
