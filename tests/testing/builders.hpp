// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Builds tasks, DAGs and workloads for tests from few numbers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::testing {

/// A short form of a task. Its times are in milliseconds for make_dag(), in nanoseconds for tick_dag() and tick_task().
struct TestTask {
  std::string name = {};
  Duration period = 0;  // 0: a data task
  Duration wcet = 1;
  std::vector<std::uint32_t> after = {};
  std::string group = {};
  Duration offset = 0;
  Duration deadline = 0;  // 0: the period
  Duration bcet = 0;      // 0: the wcet
  Duration jitter = 0;
  std::optional<int> priority = {};
};

/// Builds a DAG. Data tasks inherit their periods; deadlines are filled in.
[[nodiscard]] Dag make_dag(std::string name, const std::vector<TestTask> &tasks, std::uint32_t max_active = 0,
                           Duration unit = kMillisecond);
[[nodiscard]] Dag tick_dag(std::string name, const std::vector<TestTask> &tasks, std::uint32_t max_active = 0);
/// Builds a task alone: nothing is inherited or filled in.
[[nodiscard]] Task tick_task(const TestTask &task);

[[nodiscard]] Workload make_workload(std::vector<Dag> dags, std::uint32_t workers = 1,
                                     PreemptionMode preemption = PreemptionMode::None,
                                     PolicyKind policy = PolicyKind::RateMonotonic);

/// C, T and D of an independent task in nanoseconds, in the order of the literature.
struct Load {
  Duration wcet;
  Duration period;
  Duration deadline = 0;  // 0: the period
};

/// DAGs "a", "b", ... of one task "t" each, which can be preempted. Under PolicyKind::Fixed the first is the most
/// urgent.
[[nodiscard]] Workload independent(const std::vector<Load> &loads, std::uint32_t workers = 1,
                                   PolicyKind policy = PolicyKind::RateMonotonic);

/// One DAG of timer tasks "t0", "t1", ... of one second. Task t has priority t: the last one is the most urgent.
[[nodiscard]] Workload ladder(std::size_t tasks);

}  // namespace redag::testing
