// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Timers as callbacks: finds when they are due, and calls them.
#include <rcl/timer.h>

#include <algorithm>

#include "callback.hpp"
#include "compat.hpp"

namespace redag_rclcpp {

using redag::kNever;
using redag::runtime::Release;

namespace {

constexpr Duration kClockReads = 10 * redag::kMicrosecond;  // clock readings further apart are repeated
constexpr std::int64_t kMostMissed = 1000;                  // largest number of missed releases that are reported

/// Readings of a timer's clock and the engine's clock, taken together.
struct TimerReading {
  bool cancelled = false;
  Duration until = 0;  // time until the timer's next call; negative: overdue
  Time now = 0;        // engine's clock, read right before
};

TimerReading read_timer(const rcl_timer_t &timer, const redag::runtime::Engine &engine) {
  TimerReading reading;
  for (int attempt = 0; attempt < 3; ++attempt) {
    reading.now = engine.now();
    reading.cancelled = rcl_timer_get_time_until_next_call(&timer, &reading.until) != RCL_RET_OK;
    if (reading.cancelled) rcl_reset_error();
    if (reading.cancelled || engine.now() - reading.now < kClockReads) break;
  }
  return reading;
}

/// The timer's clock if it is ROS time, else null.
rcl_clock_t *ros_clock_of(const rcl_timer_t &timer) {
  rcl_clock_t *clock = nullptr;
  if (rcl_timer_clock(const_cast<rcl_timer_t *>(&timer), &clock) != RCL_RET_OK) rcl_reset_error();
  return clock != nullptr && clock->type == RCL_ROS_TIME ? clock : nullptr;
}

/// True if the timer's clock stands still between messages on /clock.
bool is_simulated(const rcl_timer_t &timer) {
  rcl_clock_t *clock = ros_clock_of(timer);
  bool enabled = false;
  if (clock != nullptr && rcl_is_enabled_ros_time_override(clock, &enabled) != RCL_RET_OK) rcl_reset_error();
  return enabled;
}

Duration period_of(const rcl_timer_t &timer) {
  Duration period = 0;
  if (rcl_timer_get_period(&timer, &period) != RCL_RET_OK) rcl_reset_error();
  return period;
}

}  // namespace

bool Callback::has_waited_timer() const {
  return is_timer() && (!compat::kTimersTellOfResets || ros_clock_of(*timer_handle_) != nullptr);
}

// Watches for simulated time being switched on or off: rcl then sets the timer anew without triggering anything.
void Callback::watch_clock(rclcpp::TimerBase &timer) {
  if (ros_clock_of(*timer_handle_) == nullptr) return;
  rcl_jump_threshold_t changes{};
  changes.on_clock_change = true;
  clock_watch_ = compat::clock_of(timer)->create_jump_callback(
      nullptr,
      [weak = weak_from_this()](const rcl_time_jump_t &) {
        if (const auto self = weak.lock()) self->look_at_timer();
      },
      changes);
}

void Callback::look_at_timer() {
  restarted_ = true;
  reschedule();
}

void Callback::reschedule() {
  const TimerReading reading = read_timer(*timer_handle_, engine_);
  Time due = reading.now + reading.until;
  if (reading.cancelled || (reading.until > 0 && is_simulated(*timer_handle_))) due = kNever;
  const redag::LockGuard guard(lock_);
  if (intake_ && intake_->timers().schedule(*this, due)) intake_->timers_changed();
}

Time Callback::expire(Time now, std::vector<Release> &releases, std::vector<Release> &missed) {
  if (!is_timer()) {  // a repeated release after a skip
    releases.push_back(Release{task_, now});
    return kNever;
  }
  const bool simulated = is_simulated(*timer_handle_);
  const TimerReading reading = read_timer(*timer_handle_, engine_);
  if (reading.cancelled) return kNever;
  if (reading.until > 0) return simulated ? kNever : reading.now + reading.until;

  const Duration period = period_of(*timer_handle_);
  if (simulated || period == 0) {
    // Simulated time has no points on the engine's clock, and a period of 0 has no grid.
    if (!uncalled_.exchange(true)) {
      releases.push_back(Release{task_, now});
    }
    return kNever;
  }
  // The latest point of the grid that has passed. The call itself stands for the first point that was not called.
  const Time nominal = reading.now + reading.until + -reading.until / period * period;
  if (restarted_.exchange(false)) last_release_ = kNever;
  const bool again = last_release_ != kNever && nominal - last_release_ < period / 2;
  if (!again || !uncalled_) {
    if (last_release_ != kNever) {
      const std::int64_t between = (nominal - last_release_ + period / 2) / period - 1;
      for (std::int64_t i = std::min(between, kMostMissed); i > 0; --i) missed.push_back({task_, nominal - i * period});
    }
    last_release_ = nominal;
    uncalled_ = true;
    releases.push_back(Release{task_, nominal});
  }
  return nominal + period;
}

// Consumes the expiry of a skipped job if no other job will. A timer with a grid needs none of this: the next point's
// job consumes the expiry.
void Callback::drop_expiry() {
  const auto timer = timer_.lock();
  if (!timer || (!is_simulated(*timer_handle_) && period_of(*timer_handle_) != 0)) return;
  const compat::TimerCall call(*timer);
  uncalled_ = false;
  reschedule();
}

bool Callback::execute_timer() {
  const auto timer = timer_.lock();
  if (!timer) return false;
  bool due = false;
  if (rcl_timer_is_ready(timer_handle_.get(), &due) != RCL_RET_OK) rcl_reset_error();
  uncalled_ = false;
  if (!due) {
    // The timer was cancelled or reset, or the previous job started so late that its call consumed this expiry as well.
    // In the last case the expiry is lost and counts as a miss.
    if (!restarted_ && !timer->is_canceled()) late_.fetch_add(1, std::memory_order_relaxed);
    reschedule();
    return false;
  }
  TRACETOOLS_TRACEPOINT(rclcpp_executor_execute, static_cast<const void *>(timer_handle_.get()));
  compat::TimerCall call(*timer);
  if (!call.valid()) return false;
  const bool always_due = period_of(*timer_handle_) == 0;
  if (!always_due) reschedule();
  call.execute();
  if (always_due) reschedule();
  return true;
}

}  // namespace redag_rclcpp
