// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// All that is ordered on a robot as one workload: all processes share the processors of their CPU set, so that m is the
// number of these. Analysis and simulation then see the whole robot. Refuses robots whose kernel would schedule them
// differently from that workload. Proof: docs/robot.md, "One workload". Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

/// DAGs and groups have the name of their process before them: "base/control". Threads that interfere are DAGs
/// "threads/NAME". The order is that of order_of() for `levels`; if it is not the policy's alone, the union's policy is
/// `fixed`. Errors: what analysis cannot cover, each at its entry.
[[nodiscard]] Result<LoadedWorkload> union_of(const Robot &robot, std::uint32_t levels, LoadOptions options = {});

/// The union without the jitter of links, and where its tasks come from.
struct United {
  Workload workload;
  Diagnostics warnings;
  std::vector<std::size_t> first_task;                       // by process: the TaskId of the first of its tasks
  std::vector<std::optional<std::size_t>> first_of_threads;  // by entry; nothing: it delays no task
  std::vector<bool> is_above;                                // by TaskId: before all of the order
};
[[nodiscard]] Result<United> unite(const Robot &robot, std::uint32_t levels, LoadOptions options = {});

}  // namespace redag::robot
