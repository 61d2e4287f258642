// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How many jobs of a DAG can be started and unfinished at once while every response stays within its period, so that a
// max_active or a number of threads that is at least as large never makes a job wait. Pure functions.
#pragma once

#include <cstddef>

#include "redag_analysis/core/system.hpp"

namespace redag::analysis {

/// Tasks of one grid (period and offset) answer before its next point, so that those in progress belong to one point,
/// and of these no two where one follows the other: the largest set of tasks that do not follow each other, summed over
/// the grids. Where a grid has a single task or no edges, jobs of a task still never overlap, so that responses above
/// the period do no harm there. O(tasks^3). Proof: docs/analysis.md, "Jobs in progress".
[[nodiscard]] std::size_t most_jobs_in_progress(const System &system, DagId dag);

}  // namespace redag::analysis
