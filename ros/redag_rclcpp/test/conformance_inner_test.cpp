// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Conformance: executors within an executor. Nav2's behaviour trees and its clients of services work like this: some
// callback groups are not added with their node, and an executor of rclcpp serves them, on the thread of a goal or
// within a callback.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "compat.hpp"
#include "conformance.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "spinning.hpp"
#include "test_msgs/action/fibonacci.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using rclcpp_action::ResultCode;
using test_msgs::action::Fibonacci;
using test_msgs::srv::Empty;
using ClientGoal = rclcpp_action::ClientGoalHandle<Fibonacci>;
using ServerGoal = rclcpp_action::ServerGoalHandle<Fibonacci>;

constexpr int kForever = 1000;  // as a goal's order: it does not end unless it is cancelled

std::shared_ptr<Fibonacci::Result> result_of(int order) {
  auto result = std::make_shared<Fibonacci::Result>();
  result->sequence = {order};
  return result;
}

Fibonacci::Goal goal_of(int order) {
  Fibonacci::Goal goal;
  goal.order = order;
  return goal;
}

/// An executor that serves one callback group of a node.
class GroupExecutor {
 public:
  explicit GroupExecutor(rclcpp::Node &node)
      : group(node.create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false)) {
    executor.add_callback_group(group, node.get_node_base_interface());
  }

  template <class Future>
  bool await(const Future &future) {
    return executor.spin_until_future_complete(future, kLimit) == rclcpp::FutureReturnCode::SUCCESS;
  }

  rclcpp::CallbackGroup::SharedPtr group;
  rclcpp::executors::SingleThreadedExecutor executor;
};

/// An action server that works on each goal on a new thread, as those of Nav2 do.
class ThreadedServer {
 public:
  using Work = std::function<void(ServerGoal &)>;

  ThreadedServer(const rclcpp::Node::SharedPtr &node, const std::string &name, Work work)
      : work_(std::move(work)),
        server_(rclcpp_action::create_server<Fibonacci>(
            node, name,
            [](const rclcpp_action::GoalUUID &, const std::shared_ptr<const Fibonacci::Goal> &) {
              return rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE;
            },
            [](const std::shared_ptr<ServerGoal> &) { return rclcpp_action::CancelResponse::ACCEPT; },
            [this](const std::shared_ptr<ServerGoal> &goal) {
              const std::scoped_lock lock(mutex_);
              goals_.push_back(std::async(std::launch::async, [this, goal] { work_(*goal); }));
            })) {}

 private:
  Work work_;
  std::mutex mutex_;
  std::vector<std::future<void>> goals_;
  rclcpp_action::Server<Fibonacci>::SharedPtr server_;
};

/// Drives until it is done, or until it is cancelled.
void drive(ServerGoal &goal) {
  const int order = goal.get_goal()->order;
  const auto end = std::chrono::steady_clock::now() + (order == kForever ? kLimit : 5ms);
  while (std::chrono::steady_clock::now() < end) {
    if (goal.is_canceling()) {
      goal.canceled(result_of(order));
      return;
    }
    std::this_thread::sleep_for(1ms);
  }
  goal.succeed(result_of(order));
}

/// The behaviour tree of one goal: hands it on to `drive`, and looks after it at each tick.
void tick_tree(rclcpp::Node &tree, ServerGoal &goal) {
  GroupExecutor inner(tree);
  const auto client = rclcpp_action::create_client<Fibonacci>(
      tree.get_node_base_interface(), tree.get_node_graph_interface(), tree.get_node_logging_interface(),
      tree.get_node_waitables_interface(), "drive", inner.group);
  const auto abort = [&](const char *reason) {
    ADD_FAILURE() << reason;
    goal.abort(result_of(0));
  };
  if (!client->wait_for_action_server(kLimit)) return abort("no server");
  const auto accepted = client->async_send_goal(*goal.get_goal());
  if (!inner.await(accepted) || !accepted.get()) return abort("not accepted");
  const auto result = client->async_get_result(accepted.get());
  while (result.wait_for(0s) != std::future_status::ready) {
    inner.executor.spin_some();
    if (goal.is_canceling()) {
      if (!inner.await(client->async_cancel_goal(accepted.get()))) return abort("not cancelled");
      if (!inner.await(result)) return abort("no result");
      break;
    }
    std::this_thread::sleep_for(1ms);
  }
  const auto outcome = result.get();
  if (outcome.code == ResultCode::CANCELED) return goal.canceled(outcome.result);
  goal.succeed(outcome.result);
}

/// What a user of the tree needs, in an executor of its own.
struct User {
  User() : client(rclcpp_action::create_client<Fibonacci>(node, "navigate")) { executor.add_node(node); }

  template <class Future>
  bool await(const Future &future) {
    return executor.spin_until_future_complete(future, kLimit) == rclcpp::FutureReturnCode::SUCCESS;
  }

  rclcpp::Node::SharedPtr node = std::make_shared<rclcpp::Node>("user");
  rclcpp_action::Client<Fibonacci>::SharedPtr client;
  rclcpp::executors::SingleThreadedExecutor executor;
};

TYPED_TEST(Conformance, AThreadOfAGoalServesAGroupOfANodeOfItsOwn) {
  auto tree = std::make_shared<rclcpp::Node>("tree");  // in no executor
  const ThreadedServer driver(this->node, "drive", drive);
  const ThreadedServer navigator(this->node, "navigate", [&](ServerGoal &goal) { tick_tree(*tree, goal); });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  User user;
  ASSERT_TRUE(user.client->wait_for_action_server(kLimit));
  for (int order = 1; order <= 3; ++order) {
    const auto accepted = user.client->async_send_goal(goal_of(order));
    ASSERT_TRUE(user.await(accepted) && accepted.get()) << order;
    const auto result = user.client->async_get_result(accepted.get());
    ASSERT_TRUE(user.await(result)) << order;
    EXPECT_EQ(result.get().code, ResultCode::SUCCEEDED);
    EXPECT_EQ(result.get().result->sequence, std::vector{order});
  }
}

TYPED_TEST(Conformance, AThreadOfAGoalCancelsItsOwnGoal) {
  auto tree = std::make_shared<rclcpp::Node>("tree");
  const ThreadedServer driver(this->node, "drive", drive);
  const ThreadedServer navigator(this->node, "navigate", [&](ServerGoal &goal) { tick_tree(*tree, goal); });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  User user;
  ASSERT_TRUE(user.client->wait_for_action_server(kLimit));
  const auto accepted = user.client->async_send_goal(goal_of(kForever));
  ASSERT_TRUE(user.await(accepted) && accepted.get());
  const auto result = user.client->async_get_result(accepted.get());
  ASSERT_TRUE(user.await(user.client->async_cancel_goal(accepted.get())));
  ASSERT_TRUE(user.await(result));
  EXPECT_EQ(result.get().code, ResultCode::CANCELED);
}

TYPED_TEST(Conformance, ACallbackServesAGroupOfItsNode) {
  auto other = std::make_shared<rclcpp::Node>("other");
  const auto server = other->create_service<Empty>(
      "answer", [](const std::shared_ptr<Empty::Request> &, const std::shared_ptr<Empty::Response> &) {});
  rclcpp::executors::SingleThreadedExecutor others;
  others.add_node(other);
  Spinner answering(others);
  std::atomic<int> answered{0};
  std::atomic<int> elsewhere{0};  // responses that another executor took
  // The node is in the executor, and the group is not. Each call makes a new one, as Nav2 does for each server.
  auto timer = this->node->create_wall_timer(5ms, [&] {
    GroupExecutor inner(*this->node);
    const auto client = this->node->template create_client<Empty>("answer", compat::services_qos(), inner.group);
    if (!client->wait_for_service(kLimit)) return;
    const std::thread::id caller = std::this_thread::get_id();
    const auto response = client->async_send_request(std::make_shared<Empty::Request>(),
                                                     [&elsewhere, caller](rclcpp::Client<Empty>::SharedFuture) {
                                                       if (std::this_thread::get_id() != caller) ++elsewhere;
                                                     });
    if (inner.await(response.future)) ++answered;
  });
  this->executor->add_node(this->node);
  Spinner spinner(*this->executor);
  EXPECT_TRUE(eventually([&] { return answered >= 10; }));
  EXPECT_EQ(elsewhere, 0);
}

}  // namespace
}  // namespace redag_rclcpp
