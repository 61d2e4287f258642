// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Says in words which threads of the middleware were found, what is wrong with their priorities, and how to mend it.
// Pure functions.
#pragma once

#include <string>
#include <vector>

#include "watch/middleware_threads.hpp"

namespace redag_rclcpp {

struct MiddlewareReport {
  std::string summary;                // one line: threads by priority
  std::vector<std::string> warnings;  // each with its mend
};

struct MiddlewareSetting {
  std::string rmw;  // "rmw_cyclonedds_cpp"
  int wanted = 0;   // priority that its threads were to get; 0: they were left alone
  int top_job = 0;  // highest priority of a worker
  int timer = 0;    // priority that its threads should have
};

[[nodiscard]] MiddlewareReport describe(const MiddlewareThreads &found, const MiddlewareSetting &setting);

}  // namespace redag_rclcpp
