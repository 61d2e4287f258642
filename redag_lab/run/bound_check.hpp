// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares a run on threads with its bounds: responses above their bounds and executions above the wcet, by name, with
// the assumption that broke (redag_analysis/metrics/assumptions.hpp). Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_lab/run/session.hpp"

namespace redag::lab {

struct BoundCheck {
  metrics::AssumptionCheck assumptions;  // tasks by TaskId; empty if the workload could not be analysed
  std::vector<std::string> names;        // by TaskId
  std::vector<Duration> wcets;           // by TaskId
  std::vector<std::string> methods;      // by TaskId: the method of the bound; empty: none
  std::vector<metrics::Remark> remarks;  // alarms first
  std::size_t bounded = 0;               // number of tasks with a bound
  std::string absent;                    // why some or all tasks have no bound; empty: all have one
};

/// Analyses the workload as it ran, under its executor, with the overheads that the run recorded. Responses are those
/// of the whole trace, including the warm-up.
[[nodiscard]] BoundCheck check_bounds(const Session &session);

}  // namespace redag::lab
