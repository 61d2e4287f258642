// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts how many jobs of a DAG can be started and unfinished at once while every response stays within its period. A
// max_active or a number of threads that is at least as large never makes a job wait. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis {

/// Sums, over the grids (is_released_with()), the largest set of tasks of which none follows another. Tasks of one grid
/// answer before its next point, and therefore those in progress belong to one point. In a grid with a single task or
/// without edges, responses above the period do no harm: jobs of a task still never overlap. O(tasks^3). Proof:
/// docs/analysis.md, "Jobs in progress".
[[nodiscard]] std::size_t most_jobs_in_progress(const TaskSet &task_set, DagId dag);

/// The largest set of these tasks of which none follows another: so many can execute at once while no two instances
/// overlap. Of more than 64 tasks it returns their number.
[[nodiscard]] std::uint32_t most_side_by_side(const TaskSet &task_set, const std::vector<std::uint32_t> &tasks);

}  // namespace redag::analysis
