// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Taking a message, request or response as rclcpp's executors do. Any thread may call it.
#pragma once

#include "rclcpp/exceptions.hpp"
#include "rclcpp/logging.hpp"

namespace redag_rclcpp {

/// Takes with `take`, then calls `handle`. False: there was nothing to take. Logs a failed take; `what` and `name` say
/// of what.
template <class Take, class Handle>
bool take_and_handle(const char *what, const char *name, Take take, Handle handle) {
  bool taken = false;
  try {
    taken = take();
  } catch (const rclcpp::exceptions::RCLError &error) {
    RCLCPP_ERROR(rclcpp::get_logger("redag_rclcpp"), "cannot take %s '%s': %s", what, name, error.what());
  }
  if (taken) handle();
  return taken;
}

}  // namespace redag_rclcpp
