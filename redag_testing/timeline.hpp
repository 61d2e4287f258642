// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Schedules as text for golden tests: where and when each job ran, a line per job, readable in a failure message.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "redag/sched/scheduler.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::testing {

/// A short form of a task, from which tests build workloads. Times are in milliseconds.
struct TestTask {
  std::string name;
  Duration period_ms = 0;  // 0: a data task
  Duration wcet_ms = 1;
  std::vector<std::uint32_t> after = {};
  std::string group = {};
  Duration offset_ms = 0;
  Duration deadline_ms = 0;  // 0: the period
};

/// Builds a DAG. Tasks with period 0 are data tasks; periods are inherited, and deadlines filled in.
[[nodiscard]] Dag make_dag(std::string name, const std::vector<TestTask> &tasks, std::uint32_t max_active = 0);
[[nodiscard]] Workload make_workload(std::vector<Dag> dags, std::uint32_t workers,
                                     PreemptionMode preemption = PreemptionMode::None,
                                     PolicyKind policy = PolicyKind::RateMonotonic);

/// Returns every event of a simulation with our scheduler.
[[nodiscard]] std::vector<JobEvent> simulate_events(const Workload &workload, Duration horizon,
                                                    const sim::Options &options = {});

/// One line per started job, in order of dispatch: "lo#0 w0 0-2 w1 5-6". It gives the worker and the milliseconds, cut
/// at preemptions; "5-" is still running. Then follow lines for skipped and aborted jobs: "lo#1 skipped overrun 20".
[[nodiscard]] std::string timeline(const Workload &workload, std::span<const JobEvent> events);

}  // namespace redag::testing
