// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ROS parameters of a node as options of the executor and of its monitor, with descriptions, so that `ros2 param
// describe` tells what docs/ros2.md tells. Reads a workload file; keeps nothing. Call from one thread, before spinning.
#pragma once

#include "rclcpp/node.hpp"
#include "redag_rclcpp/executor.hpp"
#include "redag_rclcpp/monitor.hpp"

namespace redag_rclcpp {

/// Declares (where that has not happened) and reads: workers, preemption, policy, ties, threads, cpu_affinity,
/// config, default_period, learn, raise_middleware, lock_memory, spin, watchdog, live, trace, bounds. The parameters
/// are read-only from then on.
///
/// `config` names a workload file: what the file says of its platform and policy counts where the parameter is at its
/// default. Throws rclcpp::exceptions::InvalidParameterValueException, whose text says which parameter, what it is and
/// what is allowed; for mistakes in the workload, every one as file:line.
[[nodiscard]] ReDAGOptions declare_options(rclcpp::Node &node);

/// The same for the monitor of an executor that gets `executor`: metrics_period, metrics_file, save_path, trace,
/// trace_events, bounds.
[[nodiscard]] MonitorOptions declare_monitor_options(rclcpp::Node &node, const ReDAGOptions &executor);

}  // namespace redag_rclcpp
