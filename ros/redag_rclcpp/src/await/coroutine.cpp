// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/coroutine.hpp"

#include <algorithm>
#include <stdexcept>

#include "await/awaited_calls.hpp"
#include "entities/callback.hpp"
#include "rclcpp/logging.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/running_job.hpp"

namespace redag_rclcpp::detail {

using std::chrono::steady_clock;

namespace {

constexpr std::chrono::milliseconds kAskAgain(10);  // between looks for the service
constexpr std::chrono::seconds kPatience(1);        // until the warning that it is not available
constexpr std::chrono::milliseconds kMayStep(100);  // between looks at a clock that the system may set

void warn(const rclcpp::ClientBase &client, bool is_attached) {
  const rclcpp::Logger logger = rclcpp::get_logger("redag_rclcpp");
  const char *const service = client.get_service_name();
  if (is_attached) {
    RCLCPP_WARN(logger, "a callback awaits service '%s', which is not available: no node offers it", service);
  } else {
    RCLCPP_WARN(logger,
                "a callback awaits service '%s', but no ReDAGExecutor takes the responses of its client: add the "
                "client's node to one, and do not use set_on_new_response_callback()",
                service);
  }
}

std::shared_ptr<rclcpp::ClientBase> existing(const std::weak_ptr<rclcpp::ClientBase> &weak) {
  auto client = weak.lock();
  if (!client) throw std::runtime_error("redag_rclcpp::call(): the client was destroyed before the response came");
  return client;
}

}  // namespace

CallbackJob::CallbackJob() : callback_(this_callback().shared_from_this()) { callback_->let_wait(); }

bool CallbackJob::lends_messages() const { return callback_->lends_messages(); }

void CallbackJob::run(redag::Coroutine coroutine) {
  redag::runtime::RunningJob &running = *redag::runtime::RunningJob::current();
  redag::runtime::run_in_job(std::move(coroutine), running.owner);
}

// The client is held only while this runs. Where it is gone, so is what the caller would do with the response.
redag::Coroutine CallBase::run() {
  const std::shared_ptr<AwaitedCalls> calls = AwaitedCalls::of(existing(client_));
  const steady_clock::time_point warn_at = steady_clock::now() + kPatience;
  for (bool warned = false;;) {
    const bool is_attached = calls->is_attached();
    if (is_attached && existing(client_)->service_is_ready()) break;
    const steady_clock::time_point now = steady_clock::now();
    if (now >= until_) co_return;
    if (now >= warn_at && !warned) {
      warned = true;
      warn(*existing(client_), is_attached);
    }
    co_await redag::sleep_until(std::min(until_, now + kAskAgain));
  }
  AwaitedCalls::Call call(*calls);
  call.send(*existing(client_), request_.get());
  for (bool in_time = true; in_time && !response_;) {
    in_time = co_await call.event().wait_until(until_);
    response_ = call.take(*existing(client_));
  }
}

ClockSleep::ClockSleep(std::shared_ptr<rclcpp::Clock> clock, const rclcpp::Time &until)
    : clock_(std::move(clock)), until_(until) {
  if (until_.get_clock_type() == clock_->get_clock_type()) return;
  throw std::invalid_argument(
      "redag_rclcpp::sleep_until(): the time is of another clock type than the clock (take it from clock->now())");
}

redag::Coroutine ClockSleep::run() {
  redag::AsyncEvent changed;
  // Called with the clock's lock held, at each message on /clock, and when use_sim_time changes.
  rcl_jump_threshold_t any{};
  any.on_clock_change = true;
  any.min_forward.nanoseconds = 1;
  any.min_backward.nanoseconds = -1;
  rclcpp::JumpHandler::SharedPtr handler;
  const bool can_be_simulated = clock_->get_clock_type() == RCL_ROS_TIME;
  if (can_be_simulated) {
    handler = clock_->create_jump_callback(
        nullptr, [&changed](const rcl_time_jump_t &) { changed.set(); }, any);
  }
  const bool is_steady = clock_->get_clock_type() == RCL_STEADY_TIME;
  for (rclcpp::Time now = clock_->now(); now < until_; now = clock_->now()) {
    if (can_be_simulated && clock_->ros_time_is_active()) {
      co_await changed;
      continue;
    }
    const std::chrono::nanoseconds rest((until_ - now).nanoseconds());
    const std::chrono::nanoseconds longest = is_steady ? rest : std::min<std::chrono::nanoseconds>(rest, kMayStep);
    co_await changed.wait_until(steady_clock::now() + longest);
  }
}

}  // namespace redag_rclcpp::detail

namespace redag_rclcpp {

detail::ClockSleep sleep_until(const std::shared_ptr<rclcpp::Clock> &clock, const rclcpp::Time &time) {
  return {clock, time};
}

detail::ClockSleep sleep_for(const std::shared_ptr<rclcpp::Clock> &clock, const rclcpp::Duration &duration) {
  return {clock, clock->now() + duration};
}

redag::runtime::DeviceHandle device(const std::string &name) { return this_callback().device(name); }

}  // namespace redag_rclcpp
