// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How many jobs of a run could execute at the same time, for any driver. A pure function.
#pragma once

#include <cstdint>

#include "redag/trace/trace.hpp"

namespace redag::trace {

/// Returns the workers of the run. For ROS 2 nodes, config.workers counts the threads that executed callbacks. With
/// preemption `os` these are more than ran at the same time, and their number differs between repetitions.
[[nodiscard]] inline std::uint32_t worker_count(const RunInfo &info) {
  return info.driver == Driver::RosNodes ? info.workload.platform.workers : info.config.workers;
}

}  // namespace redag::trace
