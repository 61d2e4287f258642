// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "phased_timer.hpp"

#include <rcl/timer.h>
#include <rcutils/time.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <utility>

#include "redag_rclcpp/distribution.hpp"

namespace redag_rclcpp::lab {

using redag::Duration;
using redag::Time;

namespace {

constexpr Duration kPhaseTolerance = redag::kMicrosecond;  // largest error of the first expiry
constexpr int kPhaseAttempts = 1000;

void set_period(const rcl_timer_t &timer, Duration period) {
  std::int64_t old = 0;
  if (rcl_timer_exchange_period(&timer, period, &old) != RCL_RET_OK) {
    rclcpp::exceptions::throw_from_rcl_error(RCL_RET_ERROR, "cannot set a timer's period");
  }
}

}  // namespace

Time timer_clock_now() noexcept {
  rcutils_time_point_value_t now = 0;
  // The call fails only for a null pointer and without a steady clock; neither happens here.
  [[maybe_unused]] const rcutils_ret_t status = rcutils_steady_time_now(&now);
  return now;
}

PhasedTimer::PhasedTimer(rclcpp::Node &node, const rclcpp::CallbackGroup::SharedPtr &group, Time first, Duration period,
                         std::function<void(std::int64_t)> call)
    : period_(period), call_(std::move(call)) {
#if REDAG_RCLCPP_HAS_TIMER_INFO
  const auto callback = [this](const rclcpp::TimerInfo &info) {
    call_((info.actual_call_time.nanoseconds() - first_expiry_) / period_);
  };
#else
  const auto callback = [this] { call_(expired()); };
#endif
  timer_ = node.create_wall_timer(std::chrono::nanoseconds(period_), callback, group);
  start_at(first);
}

// A grid begins when the timer is reset. The timer is reset with the distance to its first expiry as period, and the
// true period is set right after. The error is the time between two clock readings.
void PhasedTimer::start_at(Time first) {
  const std::shared_ptr<const rcl_timer_t> handle = timer_->get_timer_handle();
  Duration unsure = 0;
  for (int attempt = 0; attempt < kPhaseAttempts; ++attempt) {
    set_period(*handle, first - timer_clock_now());
    timer_->reset();
    set_period(*handle, period_);
    const Time before = timer_clock_now();
    const Duration until = timer_->time_until_trigger().count();
    const Time after = timer_clock_now();
    unsure = (after - before + 1) / 2;
    first_expiry_ = before + until + unsure;
    if (after + until - first <= kPhaseTolerance) break;
  }
  phase_error_ = std::abs(first_expiry_ - first) + unsure;
}

// Number of the grid point whose call this is: the one before the timer's next point.
std::int64_t PhasedTimer::expired() const {
  for (;;) {
    const Time before = timer_clock_now();
    const Duration until = timer_->time_until_trigger().count();
    const Time after = timer_clock_now();
    // Repeats the reading if the thread was preempted for so long that another point could be meant.
    if (after - before > period_ / 4) continue;
    return (before + until + period_ / 2 - first_expiry_) / period_ - 1;
  }
}

void PhasedTimer::repeat_numbering() const {
#if !REDAG_RCLCPP_HAS_TIMER_INFO
  (void)expired();
#endif
}

}  // namespace redag_rclcpp::lab
