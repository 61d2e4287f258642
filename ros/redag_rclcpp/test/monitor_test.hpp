// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shared by the tests of the monitor and of its parts.
#pragma once

#include <string>
#include <vector>

#include "diagnostic_msgs/msg/diagnostic_status.hpp"
#include "parse.hpp"

namespace redag_rclcpp {

using diagnostic_msgs::msg::DiagnosticStatus;

constexpr const char *kOneTimer = R"(
name: test
dags:
  - {name: control, tasks: [{name: loop, wcet: 2ms, callback: {node: /robot, timer: 10ms}}]}
)";

inline const DiagnosticStatus *find_status(const std::vector<DiagnosticStatus> &statuses, const std::string &name) {
  for (const DiagnosticStatus &status : statuses) {
    if (status.name == name) return &status;
  }
  return nullptr;
}

}  // namespace redag_rclcpp
