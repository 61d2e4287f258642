// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One DAG of a workload as a workload of its own, for a process of its own. Pure functions.
#pragma once

#include <cstdint>
#include <string>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"

namespace redag_rclcpp::lab {

struct WorkloadPart {
  redag::Workload workload;
  std::uint32_t first_task = 0;  // TaskId that its first task has in the whole workload
};

/// Error: no process can have a DAG to itself, because an exclusive group has tasks of several DAGs.
[[nodiscard]] redag::Result<void> check_parts(const redag::Workload &workload);

/// The part with the DAG at position `dag`. The platform, and with it the number of workers, is that of the whole.
[[nodiscard]] WorkloadPart part_of(const redag::Workload &workload, std::size_t dag);

/// Name of a part's folder of results: `2-perception`.
[[nodiscard]] std::string folder_of_part(const redag::Workload &workload, std::size_t dag);

}  // namespace redag_rclcpp::lab
