// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Assigns priorities: docs/model.md's order of tasks as numbers. A task's rank is its place in that order (0 is first).
// Its tier is the place that it shares with its equals. Its level is the tier as far as the platform can tell tiers
// apart. Pure functions without state.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag::sched {

struct Priority {
  std::uint32_t rank = 0;   // unique; breaks the last tie between jobs of different tasks
  std::uint32_t tier = 0;   // not decreasing with rank, without gaps; tasks of one tier take turns
  std::uint32_t level = 0;  // not decreasing with tier; a job preempts another only from a smaller level

  friend bool operator==(const Priority &, const Priority &) = default;
};

/// The properties of a task on which its priority depends.
struct RankedTask {
  Duration period = 0;
  Duration deadline = 0;
  int priority = 0;  // for PolicyKind::Fixed; larger is more urgent
  Criticality dag_criticality = Criticality::Normal;
  Duration dag_period = 0;  // the shortest period in its DAG
  std::uint32_t dag = 0;    // position of its DAG; then topological_rank breaks ties of the policy
  std::uint32_t topological_rank = 0;
  TaskId task;  // breaks the last tie
};

/// Returns one Priority per entry, in the order of `tasks`. With Ties::Share, tasks that the policy ranks equal (the
/// same period, say) form one tier. With Ties::Fixed, and for policies without static priorities, every task is a tier
/// of its own. `levels` is the number that the platform has (0: no limit). With enough levels, and for policies without
/// static priorities, every tier has its own level. With fewer, tasks that the policy ranks equal share one first. If
/// that does not suffice, neighbours share, spread evenly. O(n log n).
[[nodiscard]] std::vector<Priority> assign_priorities(std::span<const RankedTask> tasks, PolicyKind policy, Ties ties,
                                                      std::uint32_t levels = 0);

/// The same for whole DAGs: returns one Priority per TaskId, DAG by DAG. Requires acyclic DAGs with periods and
/// deadlines set.
[[nodiscard]] std::vector<Priority> assign_priorities(std::span<const Dag> dags, PolicyKind policy, Ties ties,
                                                      std::uint32_t levels = 0);

}  // namespace redag::sched
