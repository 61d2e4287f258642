// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// All that is ordered on a robot as one workload: all processes share the processors of their CPU set, so that m is the
// number of these. Analysis and simulation then see the whole robot. Refuses robots whose kernel would schedule them
// differently from that workload. Proof: docs/robot.md, "One workload". Pure.
#pragma once

#include "redag/base/result.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

/// DAGs and groups have the name of their process before them: "base/control". Threads that can delay tasks are DAGs
/// "threads/NAME". If the order is not the policy's alone, the union's policy is `fixed`. Errors: what analysis cannot
/// cover, each at its entry.
[[nodiscard]] Result<LoadedWorkload> union_of(const Robot &robot, LoadOptions options = {});

}  // namespace redag::robot
