// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One change of a workload that lets every deadline be shown: what `analyze` suggests. Each is tried by analyze(), none
// is a guess. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/core/system.hpp"

namespace redag::analysis {

/// More tasks than this are not tried: every trial is an analysis.
inline constexpr std::size_t kMostTasksForRemedy = 64;

/// What to change in the file, in words, or nothing where no single change that is tried suffices. In this order: an
/// execution time that has to shrink by a tenth at most, a max_active, the preemption, a task's group, one more worker,
/// an execution time that has to shrink by more. `suspects`: tasks whose execution times are tried, the first six.
/// Requires a valid workload that is not shown to be schedulable.
[[nodiscard]] std::optional<std::string> find_remedy(const Workload &workload, const AnalysisPlatform &platform,
                                                     const std::vector<TaskId> &suspects);

}  // namespace redag::analysis
