// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads ROS parameters of a node as options of the executor (monitor.hpp: of its monitor). They carry descriptions:
// `ros2 param describe` tells what docs/ros2.md tells. Also reads the workload file; keeps no state. Call from one
// thread, before spinning.
#pragma once

#include "rclcpp/node.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

/// Declares (unless declared already) and reads these parameters: workers, preemption, threads, cpu_affinity,
/// config, default_period, learn, raise_middleware, lock_memory, watchdog, trace, bounds. They are read-only from then
/// on.
///
/// `config` names a workload file. The file's policy decides the order. Its platform counts where the parameter has its
/// default. Throws rclcpp::exceptions::InvalidParameterValueException, whose text names the parameter, its value, and
/// the allowed values. Mistakes in the workload are listed all at once, each as file:line.
[[nodiscard]] ReDAGOptions declare_options(rclcpp::Node &node);

}  // namespace redag_rclcpp
