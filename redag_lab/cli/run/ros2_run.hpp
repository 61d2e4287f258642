// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One run in ROS 2, by the program run_workload of redag_rclcpp in a process of its own: rclcpp's executors, and ours,
// with real nodes and topics. Blocks until it is over.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/factorial.hpp"

namespace redag::cli {

/// The executors that run_workload knows.
[[nodiscard]] const std::vector<std::string> &ros2_executors();

/// `program`: path of run_workload; empty: `ros2 run redag_rclcpp run_workload`. `stop` ends the run early, which is an
/// error. Errors: the program cannot be started, or refused, or left no events.
[[nodiscard]] Result<experiment::FinishedRun> run_in_ros2(const experiment::PlannedRun &planned,
                                                          const std::string &program, const std::atomic<bool> &stop);

}  // namespace redag::cli
