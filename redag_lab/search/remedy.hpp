// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds one change of a workload with which every deadline is shown to be met, for the suggestion of `analyze`. Each
// change is verified by analyze(); none is a guess. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::lab {

/// The largest number of tasks for which remedies are tried: every trial is an analysis.
inline constexpr std::size_t kMostTasksForRemedy = 64;

/// Returns the change of the file, in words, or nothing if no single change that is tried suffices. An execution time
/// that has to shrink by a tenth at most comes first. Then follow a max_active, the preemption, a task's group, one
/// more worker, and an execution time that has to shrink by more. The execution times of the first six `suspects` are
/// tried. Requires a valid workload that is not shown to be schedulable.
[[nodiscard]] std::optional<std::string> find_remedy(const Workload &workload,
                                                     const analysis::AnalysisPlatform &platform,
                                                     const std::vector<TaskId> &suspects);

}  // namespace redag::lab
