// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Schedules as text, for golden tests: what ran where and when, a line a job, readable in a failure message.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "redag/sched/scheduler.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::testing {

/// A workload in few words: builder for tests. Times are in milliseconds.
struct TestTask {
  std::string name;
  Duration period_ms = 0;  // 0: a data task
  Duration wcet_ms = 1;
  std::vector<std::uint32_t> after = {};
  std::string group = {};
  Duration offset_ms = 0;
  Duration deadline_ms = 0;  // 0: the period
};

/// Data tasks are those with period 0; periods are inherited, deadlines filled in.
[[nodiscard]] Dag make_dag(std::string name, const std::vector<TestTask> &tasks, std::uint32_t max_active = 0);
[[nodiscard]] Workload make_workload(std::vector<Dag> dags, std::uint32_t workers,
                                     PreemptionMode preemption = PreemptionMode::None,
                                     PolicyKind policy = PolicyKind::RateMonotonic);

/// Every event of a simulation with our scheduler.
[[nodiscard]] std::vector<JobEvent> simulate_events(const Workload &workload, Duration horizon,
                                                    const sim::Options &options = {});

/// One line a job that started, in order of dispatch: "lo#0 w0 0-2 w1 5-6" (its worker and milliseconds, cut at
/// preemptions; "5-" still running), then lines for skipped and aborted jobs: "lo#1 skipped overrun 20".
[[nodiscard]] std::string timeline(const Workload &workload, std::span<const JobEvent> events);

}  // namespace redag::testing
