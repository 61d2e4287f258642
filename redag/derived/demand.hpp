// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The demand of one job of a task: its execution time and its release jitter. Both depend only on (seed, task, job
// number). Every executor, simulated or real, therefore gets the same jobs. Pure functions.
#pragma once

#include <cstdint>

#include "redag/model/workload.hpp"

namespace redag {

/// Processor time of job `number` of `task`, > 0: in [bcet, wcet], or one of the samples (empirical). Of a task with
/// waits, at least shortest_demand().
[[nodiscard]] Duration execution_time(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed);

/// Delay of the release of job `number` after its point on the grid, uniform in [0, jitter].
[[nodiscard]] Duration release_jitter(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed);

/// Length of wait number `wait` of job `number`, uniform in [shortest, longest]. At a device it is the time of service.
[[nodiscard]] Duration wait_time(const Task &task, TaskId id, std::uint32_t number, std::size_t wait,
                                 std::uint64_t seed);

/// Returns true if jobs of the task can differ in execution time, waits or release, among each other or between seeds.
[[nodiscard]] bool demand_varies(const Task &task);

}  // namespace redag
