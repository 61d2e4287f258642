// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callbacks that await actions, in each mode with one worker: what a user may count on. The action client is in the
// group of the callback that waits, except where a test says otherwise.
#include "redag_rclcpp/action_coroutine.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "mode_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "spinning.hpp"
#include "test_msgs/action/fibonacci.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using rclcpp_action::ResultCode;
using redag::Coroutine;
using test_msgs::action::Fibonacci;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;
using ActionClient = rclcpp_action::Client<Fibonacci>;
using GoalHandle = rclcpp_action::ClientGoalHandle<Fibonacci>;
using ServerGoal = rclcpp_action::ServerGoalHandle<Fibonacci>;
using CancelResponse = ActionClient::CancelResponse;

// What the server does with a goal, by its order. Others succeed with the order as the result.
constexpr int kRejected = 1000;
constexpr int kAborted = 1001;
constexpr int kNeverEnds = 1002;  // unless it is cancelled

constexpr std::size_t kManyResponses = 1000;  // more than the clients of a test get together

Fibonacci::Goal order(int number) {
  Fibonacci::Goal goal;
  goal.order = number;
  return goal;
}

/// The server, on a node of its own. Goals end in a timer, which publishes feedback before.
class Server {
 public:
  Server() : node(std::make_shared<rclcpp::Node>("server")) {
    server_ = rclcpp_action::create_server<Fibonacci>(
        node, "fibonacci",
        [this](const rclcpp_action::GoalUUID &, const std::shared_ptr<const Fibonacci::Goal> &goal) {
          ++asked;
          while (!answers) std::this_thread::yield();
          return goal->order == kRejected ? rclcpp_action::GoalResponse::REJECT
                                          : rclcpp_action::GoalResponse::ACCEPT_AND_EXECUTE;
        },
        [](const std::shared_ptr<ServerGoal> &) { return rclcpp_action::CancelResponse::ACCEPT; },
        [this](const std::shared_ptr<ServerGoal> &goal) { goals_.insert(goal); });
    timer_ = node->create_wall_timer(1ms, [this] { work(); });
  }

  rclcpp::Node::SharedPtr node;
  std::atomic<int> asked{0};
  std::atomic<int> canceled{0};
  std::atomic<bool> answers{true};
  std::atomic<bool> ends{true};  // false: goals only give feedback

 private:
  void work() {
    auto goals = goals_;
    for (const std::shared_ptr<ServerGoal> &goal : goals) {
      const int number = goal->get_goal()->order;
      auto feedback = std::make_shared<Fibonacci::Feedback>();
      feedback->sequence = {number};
      goal->publish_feedback(feedback);
      auto result = std::make_shared<Fibonacci::Result>();
      result->sequence = {number};
      if (goal->is_canceling()) {
        goal->canceled(result);
        ++canceled;
      } else if (!ends || number == kNeverEnds) {
        continue;
      } else if (number == kAborted) {
        goal->abort(result);
      } else {
        goal->succeed(result);
      }
      goals_.erase(goal);
    }
  }

  std::set<std::shared_ptr<ServerGoal>> goals_;  // the node's callbacks are in one group
  rclcpp_action::Server<Fibonacci>::SharedPtr server_;
  rclcpp::TimerBase::SharedPtr timer_;
};

class ActionCoroutineTest : public ModeTest {
 protected:
  void SetUp() override {
    ModeTest::SetUp();
    if (IsSkipped()) return;
    server = std::make_unique<Server>();
    client = create_client();
  }
  void TearDown() override {
    timers.clear();
    client.reset();
    server.reset();
    ModeTest::TearDown();
  }

  ActionClient::SharedPtr create_client(const rclcpp::CallbackGroup::SharedPtr &group = nullptr,
                                        const std::string &name = "fibonacci") {
    // A client's queues also receive the responses to other clients, of which ten could push out one of its own.
    rcl_action_client_options_t client_options = rcl_action_client_get_default_options();
    client_options.goal_service_qos.depth = kManyResponses;
    client_options.result_service_qos.depth = kManyResponses;
    return rclcpp_action::create_client<Fibonacci>(node, name, group, client_options);
  }
  /// A timer whose first call runs `body`; by default in the group of `client`.
  void once(const std::function<Coroutine()> &body, const rclcpp::CallbackGroup::SharedPtr &group = nullptr) {
    auto begun = std::make_shared<std::atomic<bool>>(false);
    timers.push_back(node->create_wall_timer(1ms, coroutine([body, begun]() -> Coroutine {
                                               if (!begun->exchange(true)) co_await body();
                                             }),
                                             group));
  }
  /// Spins until `condition` holds.
  void spin_until(const std::function<bool()> &condition) {
    ReDAGExecutor executor(options);
    executor.add_node(node);
    executor.add_node(server->node);
    const Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually(condition));
  }

  std::unique_ptr<Server> server;
  ActionClient::SharedPtr client;
  std::vector<rclcpp::TimerBase::SharedPtr> timers;
};

INSTANTIATE_TEST_SUITE_P(Modes, ActionCoroutineTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &test) { return std::string(to_string(test.param)); });

TEST_P(ActionCoroutineTest, TasksOfActionsAreFoundByTheirNames) {
  options.workload = parse(R"(
name: test
platform: {workers: 1}
dags:
  - name: served
    tasks: [{name: server, period: 30ms, callback: {node: /server, action: /fibonacci}}]
  - name: called
    tasks: [{name: clients, period: 40ms, callback: {node: /node, action: "/fib*"}}]
)");
  const auto other = create_client(nullptr, "other");
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    EXPECT_TRUE(co_await send_goal(client, order(7)));
    done = true;
  });
  ReDAGExecutor executor(options);
  executor.add_node(node);
  executor.add_node(server->node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return done.load(); }));
  std::vector<std::string> actions;
  for (const CallbackStats &callback : executor.stats()) {
    if (callback.id.kind == redag::Callback::Kind::Action)
      actions.push_back(to_string(callback.id) + ": " + callback.dag);
  }
  EXPECT_THAT(actions, UnorderedElementsAre("/server action /fibonacci: served", "/node action /fibonacci: called",
                                            "/node action /other: "));
}

TEST_P(ActionCoroutineTest, AGoalSucceedsAndItsFeedbackComesDuringTheWait) {
  server->ends = false;
  std::atomic<bool> inside{false};
  std::atomic<int> overlaps{0};
  std::atomic<int> others{0};
  std::atomic<int> feedbacks{0};
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    inside = true;
    const auto feedback = [&](const std::shared_ptr<GoalHandle> &, const auto &) {
      EXPECT_TRUE(inside);
      if (++feedbacks == 3) server->ends = true;
    };
    const auto goal = co_await send_goal(client, order(7), 1h, feedback);
    EXPECT_TRUE(goal);
    EXPECT_EQ(goal.answer(), GoalAnswer::Accepted);
    EXPECT_NE(goal.handle(), nullptr);
    const auto result = co_await goal.result();
    EXPECT_EQ(result->code, ResultCode::SUCCEEDED);
    EXPECT_THAT(result->result->sequence, ElementsAre(7));
    EXPECT_EQ(result->goal_id, goal.handle()->get_goal_id());
    const auto again = co_await goal.result();
    EXPECT_EQ(again, result);
    inside = false;
    done = true;
  });
  timers.push_back(node->create_wall_timer(1ms, [&] {  // of the same group
    if (inside) ++overlaps;
    ++others;
  }));
  spin_until([&] { return done && others >= 3; });
  EXPECT_GE(feedbacks, 3);
  EXPECT_EQ(overlaps, 0);
}

TEST_P(ActionCoroutineTest, GoalsOneAfterTheOther) {
  constexpr int kGoals = 50;
  std::atomic<int> right{0};
  once([&]() -> Coroutine {
    for (int i = 0; i < kGoals; ++i) {
      const auto goal = co_await send_goal(client, order(i));
      const auto result = co_await goal.result();
      if (result->code == ResultCode::SUCCEEDED && result->result->sequence.at(0) == i) ++right;
    }
  });
  spin_until([&] { return right == kGoals; });
}

TEST_P(ActionCoroutineTest, ARejectedGoal) {
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    const auto goal = co_await send_goal(client, order(kRejected));
    EXPECT_FALSE(goal);
    EXPECT_EQ(goal.answer(), GoalAnswer::Rejected);
    EXPECT_EQ(goal.handle(), nullptr);
    EXPECT_THROW((void)goal.result(), std::logic_error);
    EXPECT_THROW((void)goal.cancel(1s), std::logic_error);
    done = true;
  });
  spin_until([&] { return done.load(); });
}

TEST_P(ActionCoroutineTest, AGoalThatTheServerAborts) {
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    const auto goal = co_await send_goal(client, order(kAborted), 1h);
    const auto result = co_await goal.result(1h);
    EXPECT_EQ(result->code, ResultCode::ABORTED);
    EXPECT_THAT(result->result->sequence, ElementsAre(kAborted));
    done = true;
  });
  spin_until([&] { return done.load(); });
}

TEST_P(ActionCoroutineTest, AGoalThatTakesTooLongIsCancelled) {
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    const auto goal = co_await send_goal(client, order(kNeverEnds));
    const auto none = co_await goal.result(5ms);
    EXPECT_EQ(none, nullptr);
    const auto answer = co_await goal.cancel();
    EXPECT_EQ(answer->return_code, CancelResponse::ERROR_NONE);
    const auto result = co_await goal.result();
    EXPECT_EQ(result->code, ResultCode::CANCELED);
    const auto late = co_await goal.cancel(1h);
    EXPECT_EQ(late->return_code, CancelResponse::ERROR_GOAL_TERMINATED);
    done = true;
  });
  spin_until([&] { return done.load(); });
  EXPECT_EQ(server->canceled, 1);
}

TEST_P(ActionCoroutineTest, AServerThatIsNotThere) {
  const auto absent = create_client(nullptr, "absent");
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    const auto begin = std::chrono::steady_clock::now();
    const auto goal = co_await send_goal(absent, order(1), 20ms);
    EXPECT_GE(std::chrono::steady_clock::now() - begin, 20ms);
    EXPECT_FALSE(goal);
    EXPECT_EQ(goal.answer(), GoalAnswer::None);
    done = true;
  });
  spin_until([&] { return done.load(); });
}

// The server runs elsewhere: it keeps its thread until it answers.
TEST_P(ActionCoroutineTest, AGoalThatIsAcceptedTooLateIsCancelled) {
  server->answers = false;
  std::atomic<bool> gave_up{false};
  once([&]() -> Coroutine {
    while (server->asked == 0) {
      const auto goal = co_await send_goal(client, order(kNeverEnds), 20ms);
      EXPECT_EQ(goal.answer(), GoalAnswer::None);
    }
    gave_up = true;
  });
  rclcpp::executors::SingleThreadedExecutor elsewhere;
  elsewhere.add_node(server->node);
  const Spinner<rclcpp::executors::SingleThreadedExecutor> server_spinner(elsewhere);
  ReDAGExecutor executor(options);
  executor.add_node(node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return gave_up.load(); }));
  server->answers = true;
  EXPECT_TRUE(eventually([&] { return server->canceled == server->asked; })) << server->asked;
}

// The client's callback is a job of its own there, and handles what arrives.
TEST_P(ActionCoroutineTest, ClientsInOtherGroups) {
  constexpr int kGoals = 10;
  constexpr int kCallers = 3;
  const auto reentrant = groups.emplace_back(node->create_callback_group(rclcpp::CallbackGroupType::Reentrant));
  const std::vector<ActionClient::SharedPtr> clients{create_client(new_group()), create_client(reentrant)};
  std::atomic<int> right{0};
  for (const ActionClient::SharedPtr &its_client : clients) {
    for (int caller = 0; caller < kCallers; ++caller) {
      once(
          [&right, its_client, caller]() -> Coroutine {
            for (int i = 0; i < kGoals; ++i) {
              const auto goal = co_await send_goal(its_client, order(100 * caller + i));
              const auto result = co_await goal.result();
              if (result->result->sequence.at(0) == 100 * caller + i) ++right;
            }
          },
          new_group());
    }
  }
  options.threads = 16;
  spin_until([&] { return right == 2 * kCallers * kGoals; });
}

// The second callback waits until the first one, which holds the client's group, handles what arrives for both.
TEST_P(ActionCoroutineTest, AClientOfAnotherCallbackThatWaits) {
  constexpr int kGoals = 10;
  std::atomic<int> ended{0};
  const auto send = [&]() -> Coroutine {
    for (int i = 0; i < kGoals; ++i) {
      const auto goal = co_await send_goal(client, order(i));
      const auto result = co_await goal.result();
      EXPECT_THAT(result->result->sequence, ElementsAre(i));
    }
    ++ended;
  };
  once(send);
  once(send, new_group());
  spin_until([&] { return ended == 2; });
}

TEST_P(ActionCoroutineTest, OrdinaryGoalsOfTheSameClient) {
  std::atomic<int> ordinary{0};
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    ActionClient::SendGoalOptions callbacks;
    callbacks.result_callback = [&](const GoalHandle::WrappedResult &result) {
      EXPECT_THAT(result.result->sequence, ElementsAre(1));
      ++ordinary;
    };
    const auto server_is_there = co_await send_goal(client, order(0));
    EXPECT_TRUE(server_is_there);
    client->async_send_goal(order(1), callbacks);
    const auto goal = co_await send_goal(client, order(2));
    const auto result = co_await goal.result();
    EXPECT_THAT(result->result->sequence, ElementsAre(2));
    client->async_send_goal(order(1), callbacks);  // handled by the client's callback, after this one
    done = true;
  });
  spin_until([&] { return done && ordinary == 2; });
}

TEST_P(ActionCoroutineTest, AnExceptionOfTheFeedbackLeavesTheWait) {
  server->ends = false;
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    bool thrown = false;
    try {
      const auto goal = co_await send_goal(client, order(1),
                                           [](const auto &, const auto &) { throw std::runtime_error("feedback"); });
      (void)co_await goal.result();
    } catch (const std::runtime_error &error) {
      thrown = std::string(error.what()) == "feedback";
    }
    EXPECT_TRUE(thrown);
    done = true;
  });
  spin_until([&] { return done.load(); });
}

TEST_P(ActionCoroutineTest, AClientThatIsDestroyedEndsTheWait) {
  std::atomic<bool> waits{false};
  std::atomic<bool> done{false};
  once([&]() -> Coroutine {
    const auto goal = co_await send_goal(client, order(kNeverEnds));
    waits = true;
    std::string text;
    try {
      (void)co_await goal.result();
    } catch (const std::runtime_error &error) {
      text = error.what();
    }
    EXPECT_THAT(text, HasSubstr("destroyed"));
    done = true;
  });
  ReDAGExecutor executor(options);
  executor.add_node(node);
  executor.add_node(server->node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return waits.load(); }));
  client.reset();
  EXPECT_TRUE(eventually([&] { return done.load(); }));
}

TEST_P(ActionCoroutineTest, CancelOfTheExecutorEndsWaits) {
  struct Ended {
    ~Ended() { ++count; }
    std::atomic<int> &count;
  };
  std::atomic<int> ended{0};
  std::atomic<bool> waits{false};
  std::atomic<bool> went_on{false};
  once([&]() -> Coroutine {
    const Ended local{ended};
    const auto goal = co_await send_goal(client, order(kNeverEnds));
    waits = true;
    (void)co_await goal.result();
    went_on = true;
  });
  ReDAGExecutor executor(options);
  executor.add_node(node);
  executor.add_node(server->node);
  Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return waits.load(); }));
  EXPECT_EQ(ended, 0);
  spinner.stop();
  EXPECT_EQ(ended, 1) << "before spin() returns";
  EXPECT_FALSE(went_on);
}

}  // namespace
}  // namespace redag_rclcpp
