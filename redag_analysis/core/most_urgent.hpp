// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The most urgent tasks of a task set, without those that cannot delay them: a feature of a less urgent task takes no
// bound away. Proof: docs/analysis.md, "The most urgent tasks alone". Pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Some tasks of a task set, with their own numbers. DAGs keep theirs; one without tasks is left empty.
struct MostUrgent {
  TaskSet task_set;
  std::vector<std::uint32_t> tasks;  // by TaskId there: the TaskId in the whole
};

/// most_urgent() returns parts whose jobs are scheduled as if they were alone, each larger than the last: for each
/// feature that keeps methods from being applied, the largest part without it. None contains all tasks.
[[nodiscard]] std::vector<MostUrgent> most_urgent(const TaskSet &task_set);

/// in_whole() gives the bound of a part's task the TaskIds of the whole.
[[nodiscard]] ResponseBound in_whole(const MostUrgent &part, ResponseBound bound);

}  // namespace redag::analysis
