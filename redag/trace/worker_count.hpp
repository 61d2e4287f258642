// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How many jobs could run at the same time, whatever the driver counts as workers.
#pragma once

#include <cstdint>

#include "redag/trace/trace.hpp"

namespace redag::trace {

/// Workers of the run. ROS 2 nodes see the threads that executed their callbacks (config.workers): with preemption `os`
/// more than ran at the same time, and not the same number in each repetition.
[[nodiscard]] inline std::uint32_t worker_count(const RunInfo &info) {
  return info.driver == Driver::RosNodes ? info.workload.platform.workers : info.config.workers;
}

}  // namespace redag::trace
