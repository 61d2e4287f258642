// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "learning.hpp"

#include "rclcpp/logging.hpp"

namespace redag_rclcpp {

void Learning::begin(redag::Time now) {
  if (window_ <= 0 || begun_) return;
  until_ = redag::saturated_add(now, window_);
  begun_ = true;
  learning_ = true;
}

void Learning::look(redag::Time now) {
  if (rate_seen_.exchange(false)) static_cast<void>(registry_.adopt_rates());
  if (!learning_ || now < until_) return;
  learning_ = false;
  RCLCPP_INFO(rclcpp::get_logger("redag_rclcpp"), "learned the rates of %zu callbacks", registry_.adopt_rates());
  done_ = true;
}

}  // namespace redag_rclcpp
