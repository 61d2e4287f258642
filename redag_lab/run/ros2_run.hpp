// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Executes one run in ROS 2 with the program run_workload of redag_rclcpp_lab, in a process of its own: rclcpp's
// executors and ours, with real nodes and topics. Blocks until the run is over.
#pragma once

#include <atomic>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/factorial.hpp"

namespace redag::lab {

/// Returns the executors of run_workload.
[[nodiscard]] const std::vector<std::string> &ros2_executors();

/// `program` is the path of run_workload; empty: `ros2 run redag_rclcpp_lab run_workload`. `stop` ends the run early
/// with an error. Errors: the program cannot be started, refused the run, or left no events.
[[nodiscard]] Result<experiment::FinishedRun> run_in_ros2(const experiment::PlannedRun &planned,
                                                          const std::string &program, const std::atomic<bool> &stop);

}  // namespace redag::lab
