// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Adds runs that `run_workload` recorded, on a machine with ROS, to a factorial experiment. Each becomes a repetition
// of the executor "ros2/NAME" at the combination whose workload it ran. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_lab/experiment/factorial_plan.hpp"
#include "redag_lab/experiment/observation.hpp"
#include "redag_lab/experiment/unit_store.hpp"

namespace redag::experiment {

/// The part of a recorded run that the experiment needs.
struct RecordedRun {
  std::string file;
  trace::RunInfo info;
  std::string result;  // its observation, as a line
};
[[nodiscard]] RecordedRun record(std::string file, const trace::Trace &trace, const FactorialPlan &plan);

struct FactorialUnits {
  FactorialPlan plan;
  std::vector<FinishedUnit> units;  // by unit
};

/// Returns the plan with the recorded executors added, all its units, and the recorded runs, in their order. Platforms
/// are not compared, except the number of workers where the plan varies it. Errors: a run that is not of nodes, has
/// another length or warm-up than the plan, ran none of its workloads, or exceeds the repetitions of its combination.
[[nodiscard]] Result<FactorialUnits> with_recorded(FactorialUnits units, const std::vector<RecordedRun> &runs);

}  // namespace redag::experiment
