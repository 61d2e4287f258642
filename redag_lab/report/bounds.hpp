// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the analysis says of a run that was recorded: its workload on the platform and under the executor that really
// ran, so that a measured response stands beside the bound that it must not exceed. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"

namespace redag::report {

struct BoundOf {
  std::optional<Duration> response;  // tightest sound bound; nothing: none
  std::string method;                // that gave it
};

struct RunBounds {
  std::vector<BoundOf> tasks;  // by TaskId, on f - r; empty where `absent`
  std::vector<BoundOf> dags;   // by DagId, from a source's release to the finish of the last task
  bool schedulable = false;    // shown by sound methods
  std::vector<std::string> by;
  std::string absent;   // why nothing is bounded; empty: something is
  std::string assumes;  // the platform that was analysed: "2 workers, full preemption, no overheads"
};

/// Never an error: where a run cannot be analysed (an executor without a bound, execution times that nobody stated,
/// overheads that cannot be read) `absent` says why.
[[nodiscard]] RunBounds bounds_of(const trace::RunInfo &run);

}  // namespace redag::report
