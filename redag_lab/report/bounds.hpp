// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Analyses a recorded run: its workload on the platform and under the executor that ran. A measured response then
// stands beside its bound. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"

namespace redag::report {

struct BoundOf {
  std::optional<Duration> response;  // tightest sound bound, if any
  std::string method;                // the method of this bound
};

struct RunBounds {
  std::vector<BoundOf> tasks;  // by TaskId, on f - r; empty if `absent` is set
  std::vector<BoundOf> dags;   // by DagId, from a source's release to the finish of the last task
  bool schedulable = false;    // shown by sound methods
  std::vector<std::string> by;
  std::string absent;   // why no task is bounded; empty if some task is
  std::string assumes;  // the analysed platform: "2 workers, full preemption, no overheads"
};

/// Never fails. If a run cannot be analysed, `absent` states the reason: an executor without a bound, unknown execution
/// times, or unreadable overheads.
[[nodiscard]] RunBounds bounds_of(const trace::RunInfo &run);

}  // namespace redag::report
