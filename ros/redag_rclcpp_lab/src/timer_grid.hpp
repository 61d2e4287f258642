// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares the calls of a timer with its grid of points in time. rclcpp drops the points that have passed when it calls
// a timer late.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"
#include "redag/threads/clock.hpp"

namespace redag_rclcpp::lab {

/// One call of a timer.
struct TimerCall {
  redag::Time nominal = 0;       // the point of the grid that the call is for
  redag::Duration lateness = 0;  // since the first point that no call was for
  std::int64_t skipped = 0;      // points before `nominal` that no call was for
};

class TimerGrid {
 public:
  explicit TimerGrid(redag::Duration period) : period_(period) {}

  /// To be called at the start of the timer's callback.
  TimerCall next(rclcpp::TimerBase &timer) {
    const redag::Time now = redag::runtime::monotonic_now();
    TimerCall call;
    call.nominal = now + timer.time_until_trigger().count() - period_;
    call.lateness = now - call.nominal;
    if (last_) {
      call.skipped = std::max<std::int64_t>(
          0, std::llround(static_cast<double>(call.nominal - *last_) / static_cast<double>(period_)) - 1);
      call.lateness += call.skipped * period_;
    }
    last_ = call.nominal;
    return call;
  }

 private:
  redag::Duration period_;
  std::optional<redag::Time> last_;
};

/// Uses `amount` of this thread's processor time.
inline void use_processor(redag::Duration amount) {
  const redag::Duration end = redag::runtime::thread_cpu_now() + amount;
  while (redag::runtime::thread_cpu_now() < end) {
  }
}

}  // namespace redag_rclcpp::lab
