// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Hides differences between ROS 2 distributions behind one set of names. Humble has rclcpp 16, Jazzy 28.
#pragma once

#include <tracetools/tracetools.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "rclcpp/callback_group.hpp"
#include "rclcpp/clock.hpp"
#include "rclcpp/context.hpp"
#include "rclcpp/guard_condition.hpp"
#include "rclcpp/timer.hpp"
#include "rclcpp/version.h"
#include "rclcpp/waitable.hpp"
#include "rclcpp_action/client.hpp"
#include "rclcpp_action/server.hpp"
#if RCLCPP_VERSION_MAJOR < 21
#include "rclcpp/qos_event.hpp"
#endif

#ifndef TRACETOOLS_TRACEPOINT  // its name before Jazzy
#define TRACETOOLS_TRACEPOINT TRACEPOINT
#endif

namespace redag_rclcpp::compat {

// Since Jazzy waitables take the wait set and the data by reference.
#if RCLCPP_VERSION_MAJOR >= 28
inline void add_to_wait_set(rclcpp::Waitable &waitable, rcl_wait_set_t &set) { waitable.add_to_wait_set(set); }
inline bool is_ready(rclcpp::Waitable &waitable, const rcl_wait_set_t &set) { return waitable.is_ready(set); }
inline void execute(rclcpp::Waitable &waitable, const std::shared_ptr<void> &data) { waitable.execute(data); }
#else
inline void add_to_wait_set(rclcpp::Waitable &waitable, rcl_wait_set_t &set) { waitable.add_to_wait_set(&set); }
inline bool is_ready(rclcpp::Waitable &waitable, rcl_wait_set_t &set) { return waitable.is_ready(&set); }
inline void execute(rclcpp::Waitable &waitable, std::shared_ptr<void> &data) { waitable.execute(data); }
#endif

/// Null if the group has no guard condition yet and its context is gone.
inline rclcpp::GuardCondition::SharedPtr notify_guard_condition(rclcpp::CallbackGroup &group,
                                                                const rclcpp::Context::SharedPtr &context) {
#if RCLCPP_VERSION_MAJOR >= 28
  (void)context;
  return group.get_notify_guard_condition();
#else
  return group.get_notify_guard_condition(context);
#endif
}

/// A timer's call. The constructor consumes the expiry, which makes the next one known; execute() runs the callback.
class TimerCall {
 public:
  explicit TimerCall(rclcpp::TimerBase &timer) : timer_(timer), data_(timer.call()) {}

  /// False: the timer was cancelled.
  [[nodiscard]] bool valid() const { return static_cast<bool>(data_); }

#if RCLCPP_VERSION_MAJOR >= 28
  void execute() { timer_.execute_callback(data_); }

 private:
  rclcpp::TimerBase &timer_;
  std::shared_ptr<void> data_;
#else
  void execute() { timer_.execute_callback(); }

 private:
  rclcpp::TimerBase &timer_;
  bool data_;
#endif
};

/// True if the timer itself reports resets. Otherwise its guard condition does. Jumps of ROS time are always reported
/// by the guard condition.
#if RCLCPP_VERSION_MAJOR >= 21
inline constexpr bool kTimersTellOfResets = true;
inline void set_on_reset(rclcpp::TimerBase &timer, std::function<void()> callback) {
  timer.set_on_reset_callback([callback = std::move(callback)](std::size_t) { callback(); });
}
inline void clear_on_reset(rclcpp::TimerBase &timer) { timer.clear_on_reset_callback(); }
#else
inline constexpr bool kTimersTellOfResets = false;
inline void set_on_reset(rclcpp::TimerBase &, const std::function<void()> &) {}
inline void clear_on_reset(rclcpp::TimerBase &) {}
#endif

/// The clock of a timer, a protected member of rclcpp::TimerBase.
inline rclcpp::Clock::SharedPtr clock_of(rclcpp::TimerBase &timer) {
  struct Opened : rclcpp::TimerBase {
    using rclcpp::TimerBase::clock_;
  };
  return timer.*(&Opened::clock_);
}

/// True if the waitable's on-ready hook is not reliable:
/// - Action servers, up to Jazzy at least, report expired goals to wait sets only (rclcpp issue 2661). On newer
///   distributions the wait set costs nothing but the exact arrival times of goals.
/// - Action clients and QoS events of Humble call the hook with too few arguments for arrivals before it was set.
inline bool needs_wait_set(const rclcpp::Waitable &waitable) {
  if (dynamic_cast<const rclcpp_action::ServerBase *>(&waitable) != nullptr) return true;
#if RCLCPP_VERSION_MAJOR < 21
  return dynamic_cast<const rclcpp_action::ClientBase *>(&waitable) != nullptr ||
         dynamic_cast<const rclcpp::QOSEventHandlerBase *>(&waitable) != nullptr;
#else
  return false;
#endif
}

}  // namespace redag_rclcpp::compat
