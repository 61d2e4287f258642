// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/action_coroutine.hpp"

#include <algorithm>
#include <vector>

#include "entities/action_names.hpp"
#include "entities/callback.hpp"
#include "entities/stand_in.hpp"
#include "rclcpp/logging.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"

namespace redag_rclcpp::detail {

using std::chrono::steady_clock;

namespace {

constexpr std::chrono::milliseconds kAskAgain(10);    // between looks for the server
constexpr std::chrono::milliseconds kLookAgain(100);  // between looks whether the client exists, and is in the executor
constexpr std::chrono::seconds kPatience(1);          // until the warning that the server is not available

std::shared_ptr<rclcpp_action::ClientBase> existing(const ActionClientPointer &weak) {
  auto client = weak.lock();
  if (!client) throw std::runtime_error("redag_rclcpp: the action client was destroyed before the answer came");
  return client;
}

}  // namespace

struct Report::State {
  redag::PiMutex lock;
  bool is_set REDAG_GUARDED_BY(lock) = false;
  bool is_abandoned REDAG_GUARDED_BY(lock) = false;
  std::shared_ptr<void> value REDAG_GUARDED_BY(lock);
  std::vector<redag::AsyncEvent *> waiting REDAG_GUARDED_BY(lock);
};

/// One wait for the report. The event is set under the report's lock: it is destroyed after this.
class Report::Waiter {
 public:
  Waiter(State &state, redag::AsyncEvent &event) : state_(state), event_(event) {
    const redag::LockGuard guard(state_.lock);
    state_.waiting.push_back(&event_);
  }
  ~Waiter() {
    const redag::LockGuard guard(state_.lock);
    std::erase(state_.waiting, &event_);
  }
  Waiter(const Waiter &) = delete;
  Waiter &operator=(const Waiter &) = delete;

 private:
  State &state_;
  redag::AsyncEvent &event_;
};

Report::Report(ActionClientPointer client) : client_(std::move(client)), state_(std::make_unique<State>()) {}
Report::~Report() = default;

bool Report::set(std::shared_ptr<void> value) {
  const redag::LockGuard guard(state_->lock);
  if (state_->is_abandoned) return false;
  state_->is_set = true;
  state_->value = std::move(value);
  redag::AsyncEvent::set_all(state_->waiting);
  return true;
}

void Report::abandon() {
  const redag::LockGuard guard(state_->lock);
  state_->is_abandoned = !state_->is_set;
}

bool Report::is_set() const {
  const redag::LockGuard guard(state_->lock);
  return state_->is_set;
}

std::shared_ptr<void> Report::value() const {
  const redag::LockGuard guard(state_->lock);
  return state_->value;
}

// The frame holds the report, because what awaits it can be destroyed first, for example when a budget cuts the job
// off. The job handles what arrives for the client where the client's callback cannot, as long as it needs more.
redag::Coroutine Report::wait(std::shared_ptr<Report> report, steady_clock::time_point until) {
  redag::AsyncEvent event;
  const Waiter waiter(*report->state_, event);
  StandIn stand_in(this_callback(), event);
  for (bool was_set = false;;) {
    if (!was_set) stand_in.look_for(static_cast<const rclcpp::Waitable *>(existing(report->client_).get()));
    while (!report->is_set() && stand_in.handle_one()) {
    }
    const steady_clock::time_point now = steady_clock::now();
    if (report->is_set() || now >= until) co_return;
    was_set = co_await event.wait_until(std::min(until, now + kLookAgain));
  }
}

redag::Coroutine wait_for_server(ActionClientPointer client, steady_clock::time_point until) {
  const steady_clock::time_point warn_at = steady_clock::now() + kPatience;
  bool warned = false;
  while (!existing(client)->action_server_is_ready()) {
    const steady_clock::time_point now = steady_clock::now();
    if (now >= until) co_return;
    if (now >= warn_at && !warned) {
      warned = true;
      RCLCPP_WARN(rclcpp::get_logger("redag_rclcpp"),
                  "a callback awaits an action server of %s, which is not available: no node offers it",
                  action_type_of(*existing(client)).c_str());
    }
    co_await redag::sleep_until(std::min(until, now + kAskAgain));
  }
}

}  // namespace redag_rclcpp::detail
