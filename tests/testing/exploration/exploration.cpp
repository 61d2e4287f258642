// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/exploration/exploration.hpp"

#include <algorithm>

#include "tests/testing/exploration/exploration_model.hpp"

namespace redag::analysis {

ResponseRange Exploration::of(TaskId task) const {
  ResponseRange all;
  for (const ResponseRange &range : responses[task.value]) {
    all.best = std::min(all.best, range.best);
    all.worst = std::max(all.worst, range.worst);
  }
  return all;
}

std::optional<std::string> why_not_explore(const TaskSet &task_set) {
  if (!task_set.not_analysable.empty()) return task_set.not_analysable;
  if (task_set.has_rate_edges()) return "edges join tasks that are not released together: see the bounds for DAGs";
  const auto is_free = [&](const CompiledTask &task) {
    return task.has_gaps || task.clock != task_set.tasks.front().clock;
  };
  if (std::any_of(task_set.tasks.begin(), task_set.tasks.end(), is_free)) {
    return "nothing states when some tasks are released after others: they have no common clock";
  }
  if (task_set.mode != sched::Preemption::None)
    return "requires jobs that run to completion, but jobs can be preempted here";
  if (task_set.policy == PolicyKind::Fifo) return "under fifo, the order of two jobs depends on when they became ready";
  if (task_set.frozen > 0) return "stalls of the machine can occur at any time";
  const bool has_data =
      std::any_of(task_set.tasks.begin(), task_set.tasks.end(), [](const CompiledTask &task) { return task.data; });
  if (task_set.policy == PolicyKind::Edf && has_data) {
    return "under edf, the deadlines of data tasks depend on when they are released";
  }
  const auto too_late = [](const CompiledTask &task) {
    return task.offset > kLongestExplored || task.jitter > kLongestExplored;
  };
  if (hyperperiod_of(task_set) > kLongestExplored ||
      std::any_of(task_set.tasks.begin(), task_set.tasks.end(), too_late)) {
    return "the hyperperiod, an offset or a jitter is too long";
  }
  return std::nullopt;
}

}  // namespace redag::analysis
