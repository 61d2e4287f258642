// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Priorities: the order of docs/model.md turned into numbers. A task's rank is its place in the order of its policy (0
// first), its tier the place that it shares with its equals, its level the tier as the platform can tell it apart.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag::sched {

struct Priority {
  std::uint32_t rank = 0;   // unique; the last of the ties between jobs of different tasks
  std::uint32_t tier = 0;   // not decreasing with rank, without gaps; tasks of one tier take turns
  std::uint32_t level = 0;  // not decreasing with tier; a job preempts another only from a smaller level

  friend bool operator==(const Priority &, const Priority &) = default;
};

/// A task as the order sees it.
struct RankedTask {
  Duration period = 0;
  Duration deadline = 0;
  int priority = 0;  // for PolicyKind::Fixed; larger is more urgent
  Criticality dag_criticality = Criticality::Normal;
  Duration dag_period = 0;  // the shortest period in its DAG
  std::uint32_t dag = 0;    // position of the DAG, and within that of the task: ties of the policy
  std::uint32_t topological_rank = 0;
  TaskId task;  // the last tie
};

/// One Priority per entry, in the order of `tasks`. With Ties::Share, tasks that the policy ranks equal (the same
/// period, say) are one tier; with Ties::Fixed, and for policies without static priorities, every task is one.
/// `levels`: how many the platform has, 0 for no limit. With enough levels every tier has its own. With fewer, tasks
/// that the policy ranks equal share one first; if that is not enough, neighbours share, spread evenly. Policies
/// without static priorities give every task a level of its own. O(n log n).
[[nodiscard]] std::vector<Priority> assign_priorities(std::span<const RankedTask> tasks, PolicyKind policy, Ties ties,
                                                      std::uint32_t levels = 0);

/// The same for whole DAGs: one Priority per TaskId (DAG by DAG). Requires acyclic DAGs with periods and deadlines set.
[[nodiscard]] std::vector<Priority> assign_priorities(std::span<const Dag> dags, PolicyKind policy, Ties ties,
                                                      std::uint32_t levels = 0);

}  // namespace redag::sched
