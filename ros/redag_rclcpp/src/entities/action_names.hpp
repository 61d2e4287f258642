// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// rclcpp tells neither the name of an action nor its type. Both follow from what its client or server is made of.
#pragma once

#include <string>

#include "rclcpp/context.hpp"
#include "rclcpp/waitable.hpp"

namespace redag_rclcpp {

/// "/fibonacci" for a client or server of that action: a wait set names the services that it consists of. Nothing may
/// wait for the waitable meanwhile, because it notes its places in the wait set that it joined last. Throws, as rclcpp
/// does, if the context was shut down.
[[nodiscard]] std::string action_name_of(rclcpp::Waitable &waitable, rclcpp::Context &context);

/// "test_msgs::action::Fibonacci" for a client or server of that action: the argument of its class template.
[[nodiscard]] std::string action_type_of(const rclcpp::Waitable &waitable);

}  // namespace redag_rclcpp
