// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of DAGs that nothing else delays. Such a DAG is alone on the platform, or the max_active of all that
// could interfere leave it enough workers. Pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// The order in which disjoint_paths() takes paths. The path with the most tasks does not change with execution times.
enum class Heaviest : std::uint8_t { Longest, MostTasks };

/// Returns the lengths of at most `count` paths that share no task: the heaviest, then the heaviest in the rest, and so
/// on. A path may lead through tasks of earlier ones without counting them. O(count (tasks + edges)).
[[nodiscard]] std::vector<Duration> disjoint_paths(const TaskSet &task_set, const Unit &unit, std::size_t count,
                                                   Heaviest heaviest);

/// Bounds the response of a DAG on `workers` of its own: min over j of len(l_0) + floor((vol - sum_{i <= j} len(l_i)) /
/// (workers - j)). l_0 is the longest path, and l_i the longest in what is left without l_0 .. l_{i-1}. Q. He, N. Guan,
/// M. Lv, X. Jiang, W. Chang, RTSS 2022, theorem 1; j = 0 is the bound of R. Graham, 1969. O(workers (tasks + edges)).
[[nodiscard]] Duration long_paths_response(const TaskSet &task_set, const Unit &unit, std::uint32_t workers);

/// Bounds every DAG from which no other can take a worker, or whose max_active and those of the more urgent DAGs sum up
/// to at most m. Where jobs are not preempted at once, the sum is over all DAGs. Proof: docs/analysis.md, "Isolation".
[[nodiscard]] Method isolated();

}  // namespace redag::analysis
