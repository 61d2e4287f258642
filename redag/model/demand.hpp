// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What one job of one task asks for: its execution time and its release jitter. Both depend on (seed, task, job number)
// alone, so every executor, simulated or real, is given the same jobs.
#pragma once

#include <cstdint>

#include "redag/model/workload.hpp"

namespace redag {

/// Processor time of job `number` of `task`, in [bcet, wcet] (empirical: one of the samples), > 0.
[[nodiscard]] Duration execution_time(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed);

/// Delay of the release of job `number` after its point on the grid, uniform in [0, jitter].
[[nodiscard]] Duration release_jitter(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed);

/// Whether jobs of the task, or those of other seeds, can differ in execution time or release.
[[nodiscard]] bool demand_varies(const Task &task);

}  // namespace redag
