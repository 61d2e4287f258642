// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The processes that bench_ros2_control measures. Both run until SIGINT, and take arguments for ROS.
#pragma once

#include <string>

namespace redag_rclcpp::lab {

/// controller_manager, its update loop as a timer of another node, and the planner, all on one executor. `executor`: a
/// name of peer_names(), or "redag" for ReDAGExecutor, with parameters of the node /robot. Returns the exit status.
int run_robot(const std::string &executor, int argc, char **argv);

/// The planner alone.
int run_planner(int argc, char **argv);

}  // namespace redag_rclcpp::lab
