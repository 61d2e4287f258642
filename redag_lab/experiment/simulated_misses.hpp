// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A necessary test by simulation. A workload with an observed deadline miss is not schedulable; one without may be. The
// test ends at the first miss. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::experiment {

struct SimulationEffort {
  std::uint32_t offsets = 5;  // runs with random offsets, besides the one in which all tasks are released together
  std::uint32_t periods = 5;  // length of a run, in periods of the slowest task

  friend bool operator==(const SimulationEffort &, const SimulationEffort &) = default;
};

/// A run with a miss, for `redag simulate` to repeat with this duration and seed.
struct SeenMiss {
  Workload workload;
  Duration duration = 0;
  std::uint64_t seed = 0;
  std::string what;  // "dag0.t1: job 3 answered after 12ms, its deadline is 10ms"
};

/// Searches for a miss; every job executes for its wcet. A miss is a response above the deadline, a DAG's instance
/// above its end-to-end deadline, or a skipped job. `task_set` is `workload` compiled on the platform that it states.
[[nodiscard]] std::optional<SeenMiss> find_miss(const Workload &workload, const analysis::TaskSet &task_set,
                                                const SimulationEffort &effort, std::uint64_t seed);

}  // namespace redag::experiment
