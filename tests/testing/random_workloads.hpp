// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Random workloads for tests. random_workload() makes tiny ones with difficult features: equal periods and deadlines,
// edges between rates, AND-joins, groups across DAGs, tight bounds and queues, several tasks a level. contended() makes
// realistic ones with generate(). random_run() has all features. bound_property.hpp has those that satisfy the
// assumptions of a bound. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/derived/rng.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::testing {

[[nodiscard]] bool chance(Rng &rng, double probability);
/// Draws from the range, which includes both ends.
[[nodiscard]] std::uint32_t between(Rng &rng, std::uint32_t low, std::uint32_t high);

struct RandomWorkloadLimits {
  std::uint32_t max_dags = 3;
  std::uint32_t max_tasks = 4;  // per DAG
  bool groups = true;
  bool bounds = true;   // max_active, max_pending, queues
  bool data = true;     // data tasks; otherwise all tasks are timers
  bool overlap = true;  // jobs of one task can overlap (concurrency above 1)
};

/// A valid workload; times are a few microseconds.
[[nodiscard]] Workload random_workload(Rng &rng, const RandomWorkloadLimits &limits = {});

/// One more DAG like those of random_workload(), for add_dag.
[[nodiscard]] Dag random_dag(Rng &rng, const RandomWorkloadLimits &limits = {});

/// Up to four DAGs of generate() with much contention, of any shape, policy and mode; the load is from a fifth of the
/// workers to above them. Adds what generate() does not draw: max_pending, budgets, regions, concurrency, priorities;
/// with `overload` also wcet_low, degradation, and budgets that do not abort.
[[nodiscard]] Workload contended(Rng &rng, bool overload = true);

/// No, one or two devices of one or two slots.
[[nodiscard]] std::vector<Device> random_devices(Rng &rng, bool has_order = true);

/// Adds devices, and waits to about half of the tasks.
void add_waits(Rng &rng, Workload &workload);

/// Divides the platform into one to three clusters of one to three workers, and the DAGs among them. A group becomes
/// one of its cluster.
void divide(Rng &rng, Workload &workload);

/// Gives sources of the DAG clocks of their own: free timers and events.
void free_sources(Rng &rng, Dag &dag);

/// A workload, and how a scheduler runs it.
struct RandomRun {
  Workload workload;
  sched::Config config;
};

/// Draws every feature (features.hpp) with any others, for properties of all of them together: one of the workloads
/// above, with waits or clusters, clocks, deadlines and limits. Half of the runs have a moderate load, and bounds.
[[nodiscard]] RandomRun random_run(Rng &rng);

/// Draws 1 to 3 workers. Full preemption with a static policy has limited levels or threads every other time.
[[nodiscard]] sched::Config random_config(Rng &rng, PolicyKind policy, sched::Preemption preemption,
                                          std::size_t task_count);

/// Describes the workload: one line per task.
[[nodiscard]] std::string describe(const Workload &workload, const sched::Config &config);

}  // namespace redag::testing
