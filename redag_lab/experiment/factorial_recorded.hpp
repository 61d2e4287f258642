// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs that were recorded elsewhere, by `run_workload` on a machine with ROS, as runs of a factorial experiment: each
// becomes a repetition of the executor "ros2/NAME" at the combination whose workload it ran. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_lab/experiment/factorial_plan.hpp"
#include "redag_lab/experiment/journal.hpp"
#include "redag_lab/experiment/observation.hpp"

namespace redag::experiment {

/// What is kept of a recorded run.
struct RecordedRun {
  std::string file;
  trace::RunInfo info;
  std::string result;  // its observation
};
[[nodiscard]] RecordedRun record(std::string file, const trace::Trace &trace, const FactorialPlan &plan);

struct FactorialUnits {
  FactorialPlan plan;
  std::vector<FinishedUnit> units;  // by unit
};

/// The plan with the recorded executors added, all its units, and the recorded runs, in their order. Platforms are not
/// compared, but for the number of workers where the plan varies it. Errors: a run that is not of nodes, lasted or
/// warmed up otherwise than the plan says, ran no workload of it, or is one too many for its combination.
[[nodiscard]] Result<FactorialUnits> with_recorded(FactorialUnits units, const std::vector<RecordedRun> &runs);

}  // namespace redag::experiment
