// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// rclcpp does not tell the names of actions. Messages show their types instead.
#pragma once

#include <string>

#include "rclcpp/waitable.hpp"

namespace redag_rclcpp {

/// "test_msgs::action::Fibonacci" for a client or server of that action: the argument of its class template.
[[nodiscard]] std::string action_type_of(const rclcpp::Waitable &waitable);

}  // namespace redag_rclcpp
