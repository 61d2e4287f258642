// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds what in a workload keeps one task or DAG from a bound, for `analyze --explain`. Each answer is verified by
// analysing the workload without it. Pure functions.
#pragma once

#include <optional>
#include <string>

#include "redag_lab/search/analysed.hpp"

namespace redag::lab {

/// A key of a task or a DAG in the file, and what its removal gives the row.
struct Obstacle {
  DagId dag;
  TaskId task;      // invalid: the key is the DAG's
  std::string key;  // "budget", "max_active", ...
  Standing standing = Standing::NoBound;
  std::optional<Duration> response;
};

/// Returns the key without which the row stands best. Keys of tasks that come after the row's task, or are less urgent
/// under preemption, are not tried. Empty if no single removal gives a better standing, or if there are more tasks than
/// kMostTasksForRemedy (remedy.hpp).
[[nodiscard]] std::optional<Obstacle> find_obstacle(const Analysed &analysed, const Row &row);

}  // namespace redag::lab
