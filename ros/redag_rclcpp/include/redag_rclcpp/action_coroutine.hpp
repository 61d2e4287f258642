// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Actions for callbacks that wait (coroutine.hpp), also where the action client is in the callback's own mutually
// exclusive group:
//
//   const auto goal = co_await redag_rclcpp::send_goal(client_, Dock::Goal());
//   if (!goal) co_return;  // rejected
//   const auto result = co_await goal.result();
//   if (result->code == rclcpp_action::ResultCode::SUCCEEDED) leave();
//
// A program that includes this links rclcpp_action. docs/ros2.md, "Callbacks that wait", has the rules.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "rclcpp_action/client.hpp"
#include "redag_rclcpp/coroutine.hpp"

namespace redag_rclcpp {

enum class GoalAnswer : std::uint8_t { Accepted, Rejected, None };  // None: there was none in time

namespace detail {

using ActionClientPointer = std::weak_ptr<rclcpp_action::ClientBase>;  // the coroutine keeps no entity of its node

/// What an action client's callback reports once, from any thread: the answer to a goal, its result, or the answer to a
/// cancel request. Coroutines wait for it.
class Report {
 public:
  explicit Report(ActionClientPointer client);
  ~Report();
  Report(const Report &) = delete;
  Report &operator=(const Report &) = delete;

  /// Returns false after abandon().
  bool set(std::shared_ptr<void> value);
  /// From here on, set() returns false. Without effect once it was set.
  void abandon();
  [[nodiscard]] bool is_set() const;
  [[nodiscard]] std::shared_ptr<void> value() const;

  /// Waits until it is set, or `until` has passed. Throws std::runtime_error if the client is destroyed meanwhile.
  [[nodiscard]] static redag::Coroutine wait(std::shared_ptr<Report> report,
                                             std::chrono::steady_clock::time_point until);

 private:
  class Waiter;
  struct State;
  const ActionClientPointer client_;
  const std::unique_ptr<State> state_;
};

/// Waits until the action's server is available, or `until` has passed.
[[nodiscard]] redag::Coroutine wait_for_server(ActionClientPointer client, std::chrono::steady_clock::time_point until);

/// What is kept of an accepted goal.
template <class Action>
struct AcceptedGoal {
  std::weak_ptr<rclcpp_action::Client<Action>> client;
  typename rclcpp_action::ClientGoalHandle<Action>::SharedPtr handle;
  std::shared_ptr<Report> result;
};

/// For co_await: see Goal::result().
template <class Action>
class GoalResult : public Awaitable<GoalResult<Action>> {
 public:
  using Wrapped = typename rclcpp_action::ClientGoalHandle<Action>::WrappedResult;

  GoalResult(std::shared_ptr<Report> report, std::chrono::steady_clock::time_point until)
      : report_(std::move(report)), until_(until) {}

  [[nodiscard]] redag::Coroutine run() { return Report::wait(report_, until_); }
  [[nodiscard]] std::shared_ptr<const Wrapped> result() {
    return std::static_pointer_cast<const Wrapped>(report_->value());
  }

 private:
  std::shared_ptr<Report> report_;
  std::chrono::steady_clock::time_point until_;
};

/// For co_await: see Goal::cancel().
template <class Action>
class CancelGoal : public Awaitable<CancelGoal<Action>> {
 public:
  using Response = typename rclcpp_action::Client<Action>::CancelResponse;

  CancelGoal(AcceptedGoal<Action> goal, std::chrono::steady_clock::time_point until)
      : goal_(std::move(goal)), until_(until), report_(std::make_shared<Report>(goal_.client)) {}

  [[nodiscard]] redag::Coroutine run() {
    send();
    return Report::wait(report_, until_);
  }
  [[nodiscard]] std::shared_ptr<Response> result() { return std::static_pointer_cast<Response>(report_->value()); }

 private:
  void send() {
    const auto client = goal_.client.lock();
    if (!client) return;  // wait() says so
    try {
      client->async_cancel_goal(goal_.handle,
                                [report = report_](std::shared_ptr<Response> response) { report->set(response); });
    } catch (const rclcpp_action::exceptions::UnknownGoalHandleError &) {
      // The client has the result, and has forgotten the goal.
      const auto response = std::make_shared<Response>();
      response->return_code = Response::ERROR_GOAL_TERMINATED;
      report_->set(response);
    }
  }

  AcceptedGoal<Action> goal_;
  std::chrono::steady_clock::time_point until_;
  std::shared_ptr<Report> report_;
};

}  // namespace detail

/// A goal that was sent: the server's answer, and if it was accepted, what follows. Copies are the same goal. May be
/// used by several coroutines.
template <class Action>
class Goal {
 public:
  using Handle = rclcpp_action::ClientGoalHandle<Action>;

  explicit Goal(GoalAnswer answer, detail::AcceptedGoal<Action> accepted = {})
      : answer_(answer), accepted_(std::move(accepted)) {}

  /// True if the goal was accepted.
  [[nodiscard]] explicit operator bool() const { return answer_ == GoalAnswer::Accepted; }
  [[nodiscard]] GoalAnswer answer() const { return answer_; }
  /// rclcpp's handle, with the goal's id and status. Null if the goal was not accepted. Do not ask the client for its
  /// result: result() has it.
  [[nodiscard]] const std::shared_ptr<Handle> &handle() const { return accepted_.handle; }

  /// co_await result(): waits until the goal has ended, and returns rclcpp's WrappedResult. Its `code` says how it
  /// ended: SUCCEEDED, ABORTED, CANCELED, or UNKNOWN if the server does not know. Once it is there, later calls return
  /// it at once. This and the following functions throw std::logic_error if the goal was not accepted.
  [[nodiscard]] detail::GoalResult<Action> result() const {
    return {accepted().result, std::chrono::steady_clock::time_point::max()};
  }
  /// The same with a limit: returns null if the goal has not ended by then. The goal goes on.
  template <class Rep, class Period>
  [[nodiscard]] detail::GoalResult<Action> result(std::chrono::duration<Rep, Period> timeout) const {
    return {accepted().result, redag::from_now(timeout)};
  }
  /// co_await cancel(): asks the server to cancel the goal, and returns its answer (action_msgs/srv/CancelGoal). The
  /// goal has ended when result() says so.
  [[nodiscard]] detail::CancelGoal<Action> cancel() const {
    return {accepted(), std::chrono::steady_clock::time_point::max()};
  }
  /// The same with a limit: returns null if there is no answer by then.
  template <class Rep, class Period>
  [[nodiscard]] detail::CancelGoal<Action> cancel(std::chrono::duration<Rep, Period> timeout) const {
    return {accepted(), redag::from_now(timeout)};
  }

 private:
  [[nodiscard]] const detail::AcceptedGoal<Action> &accepted() const {
    if (answer_ == GoalAnswer::Accepted) return accepted_;
    throw std::logic_error("redag_rclcpp::Goal: the goal was not accepted (test it first: if (goal) ...)");
  }

  GoalAnswer answer_;
  detail::AcceptedGoal<Action> accepted_;
};

namespace detail {

template <class Action>
using Feedback = typename rclcpp_action::ClientGoalHandle<Action>::FeedbackCallback;

/// For co_await: see send_goal().
template <class Action>
class SendGoal : public Awaitable<SendGoal<Action>> {
 public:
  using Client = rclcpp_action::Client<Action>;
  using Handle = rclcpp_action::ClientGoalHandle<Action>;

  SendGoal(const std::shared_ptr<Client> &client, typename Action::Goal goal, Feedback<Action> feedback,
           std::chrono::steady_clock::time_point until)
      : client_(client),
        goal_(std::move(goal)),
        feedback_(std::move(feedback)),
        until_(until),
        answer_(std::make_shared<Report>(client)),
        result_(std::make_shared<Report>(client)) {}

  [[nodiscard]] redag::Coroutine run() {
    // A goal that is accepted after this wait is cancelled.
    const struct Abandon {
      ~Abandon() { answer->abandon(); }
      std::shared_ptr<Report> answer;
    } abandon{answer_};
    co_await wait_for_server(client_, until_);
    if (std::chrono::steady_clock::now() >= until_) co_return;
    send();
    co_await Report::wait(answer_, until_);
  }
  [[nodiscard]] Goal<Action> result() {
    if (!answer_->is_set()) return Goal<Action>(GoalAnswer::None);
    auto handle = std::static_pointer_cast<Handle>(answer_->value());
    if (!handle) return Goal<Action>(GoalAnswer::Rejected);
    return Goal<Action>(GoalAnswer::Accepted, {client_, std::move(handle), result_});
  }

 private:
  void send() {
    const auto client = client_.lock();
    if (!client) return;  // wait() says so
    typename Client::SendGoalOptions options;
    options.goal_response_callback = [weak = client_, answer = answer_](std::shared_ptr<Handle> handle) {
      if (answer->set(handle) || !handle) return;
      if (const auto its_client = weak.lock()) its_client->async_cancel_goal(handle);
    };
    // Weak: the client keeps these functions until the goal has ended, and a Goal keeps the report. Without a Goal,
    // what the user's function refers to may be gone.
    if (feedback_) {
      options.feedback_callback = [weak = std::weak_ptr<Report>(result_), feedback = std::move(feedback_)](
                                      const std::shared_ptr<Handle> &handle,
                                      const std::shared_ptr<const typename Action::Feedback> &message) {
        if (const auto wanted = weak.lock()) feedback(handle, message);
      };
    }
    options.result_callback = [weak = std::weak_ptr<Report>(result_)](const typename Handle::WrappedResult &result) {
      if (const auto report = weak.lock()) {
        report->set(std::make_shared<typename Handle::WrappedResult>(result));
      }
    };
    client->async_send_goal(goal_, options);
  }

  std::weak_ptr<Client> client_;
  typename Action::Goal goal_;
  Feedback<Action> feedback_;
  std::chrono::steady_clock::time_point until_;
  std::shared_ptr<Report> answer_;
  std::shared_ptr<Report> result_;
};

template <class Function, class Action>
concept IsFeedback = std::is_constructible_v<Feedback<Action>, Function>;

template <class Action, class Function>
[[nodiscard]] Feedback<Action> as_feedback(Function &&function) {
#if defined(__GNUC__) && !defined(__clang__)
  // Seen with GCC 12: of a lambda that stands in the co_await itself, what it has captured is destroyed twice.
  static_assert(std::is_lvalue_reference_v<Function> || std::is_trivially_destructible_v<Function>,
                "GCC destroys what this function has captured twice: give the function a name before the co_await "
                "(const auto f = [...] {...}; co_await send_goal(client, goal, f);)");
#endif
  return Feedback<Action>(std::forward<Function>(function));
}

}  // namespace detail

/// co_await send_goal(client, goal): sends the goal and returns the server's answer, as a Goal. Waits for the server to
/// be available first, and logs a warning if that takes longer than a second. Throws std::runtime_error if the client
/// is destroyed meanwhile.
template <class Action>
[[nodiscard]] detail::SendGoal<Action> send_goal(const std::shared_ptr<rclcpp_action::Client<Action>> &client,
                                                 typename Action::Goal goal) {
  return {client, std::move(goal), nullptr, std::chrono::steady_clock::time_point::max()};
}
/// The same with a limit on all that: the answer is GoalAnswer::None if there is none after `timeout` on
/// std::chrono::steady_clock. If the goal is accepted later, it is cancelled.
template <class Action, class Rep, class Period>
[[nodiscard]] detail::SendGoal<Action> send_goal(const std::shared_ptr<rclcpp_action::Client<Action>> &client,
                                                 typename Action::Goal goal,
                                                 std::chrono::duration<Rep, Period> timeout) {
  return {client, std::move(goal), nullptr, redag::from_now(timeout)};
}
/// Both with a function that is called with the goal's handle and its feedback, as long as a copy of the Goal exists.
/// If the client is in the group of the callback that waits, this happens while that callback awaits something of the
/// goal.
template <class Action, detail::IsFeedback<Action> Function>
[[nodiscard]] detail::SendGoal<Action> send_goal(const std::shared_ptr<rclcpp_action::Client<Action>> &client,
                                                 typename Action::Goal goal, Function &&feedback) {
  return {client, std::move(goal), detail::as_feedback<Action>(std::forward<Function>(feedback)),
          std::chrono::steady_clock::time_point::max()};
}
template <class Action, class Rep, class Period, detail::IsFeedback<Action> Function>
[[nodiscard]] detail::SendGoal<Action> send_goal(const std::shared_ptr<rclcpp_action::Client<Action>> &client,
                                                 typename Action::Goal goal, std::chrono::duration<Rep, Period> timeout,
                                                 Function &&feedback) {
  return {client, std::move(goal), detail::as_feedback<Action>(std::forward<Function>(feedback)),
          redag::from_now(timeout)};
}

}  // namespace redag_rclcpp
