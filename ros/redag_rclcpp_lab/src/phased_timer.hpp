// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A wall timer whose grid begins at a given time: it expires at first + k * period, k = 0, 1, ... Its callback runs
// where the callback group's executor runs it; nothing else here may run at the same time.
#pragma once

#include <cstdint>
#include <functional>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

/// Reads rclcpp's steady clock, on which timers expire. In some distributions it differs from std::chrono's.
[[nodiscard]] redag::Time timer_clock_now() noexcept;

class PhasedTimer {
 public:
  /// Creates and starts the timer, well before `first` (on timer_clock_now()). `call` gets k; it can come before its
  /// point by as much as phase_error(). May throw rclcpp's exceptions.
  PhasedTimer(rclcpp::Node &node, const rclcpp::CallbackGroup::SharedPtr &group, redag::Time first,
              redag::Duration period, std::function<void(std::int64_t)> call);
  PhasedTimer(const PhasedTimer &) = delete;
  PhasedTimer &operator=(const PhasedTimer &) = delete;

  /// Largest distance of the grid from `first`.
  [[nodiscard]] redag::Duration phase_error() const { return phase_error_; }

  /// Does again what a call does to find its k, so that the time for it can be measured.
  void repeat_numbering() const;

 private:
  void start_at(redag::Time first);
  [[nodiscard]] std::int64_t expired() const;

  const redag::Duration period_;
  const std::function<void(std::int64_t)> call_;
  rclcpp::TimerBase::SharedPtr timer_;
  redag::Time first_expiry_ = 0;
  redag::Duration phase_error_ = 0;
};

}  // namespace redag_rclcpp::lab
