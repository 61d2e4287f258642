// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/coroutine.hpp"

#include <algorithm>
#include <stdexcept>

#include "awaited_calls.hpp"
#include "callback.hpp"
#include "rclcpp/logging.hpp"
#include "redag/runtime/coroutine_body.hpp"
#include "redag/runtime/running_job.hpp"

namespace redag_rclcpp::detail {

using std::chrono::steady_clock;

namespace {

constexpr std::chrono::milliseconds kAskAgain(10);  // between looks for the service
constexpr std::chrono::seconds kPatience(1);        // until the warning that it is not available

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

Callback &this_callback() {
  const redag::runtime::RunningJob *const running = redag::runtime::RunningJob::current();
  auto *const callback = running == nullptr ? nullptr : dynamic_cast<Callback *>(running->owner);
  if (callback != nullptr) return *callback;
  throw std::logic_error(
      "redag_rclcpp::coroutine(): the callback runs in no ReDAGExecutor (add its node to one, or use a callback that "
      "does not wait)");
}

}  // namespace

CallbackJob::CallbackJob() : callback_(this_callback().shared_from_this()) { callback_->let_wait(); }

bool CallbackJob::lends_messages() const { return callback_->lends_messages(); }

void CallbackJob::run(redag::Coroutine coroutine) {
  redag::runtime::RunningJob &running = *redag::runtime::RunningJob::current();
  redag::runtime::run_in_job(std::move(coroutine), running.owner);
}

void CallbackJob::end() const { callback_->coroutine_ended(); }

// The client is held only while this runs. Where it is gone, so is what the caller would do with the response.
redag::Coroutine CallBase::exchange() {
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

}  // namespace redag_rclcpp::detail

namespace redag_rclcpp {

redag::runtime::DeviceHandle device(const std::string &name) { return detail::this_callback().device(name); }

}  // namespace redag_rclcpp
