// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tasks whose jobs wait without a worker (docs/model.md, "Waits"): what a job does between its waits, and a refusal for
// what knows no waits. Pure functions.
#pragma once

#include <string_view>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"

namespace redag {

[[nodiscard]] bool has_waits(const Workload &workload);

/// For what knows no waits: an error that names it and the first task that waits.
[[nodiscard]] Result<void> refuse_waits(const Workload &workload, std::string_view who);

/// Returns the processor time after which a job that executes for `demand` begins wait number `wait` of its task. The
/// demand is divided as the wcet is, and each stretch takes at least 1 ns. Requires demand >= shortest_demand(task).
[[nodiscard]] Duration wait_point(const Task &task, std::size_t wait, Duration demand);

/// Returns the least processor time of a job: 1 ns before each wait, and 1 ns after the last one.
[[nodiscard]] Duration shortest_demand(const Task &task);

/// Returns the sum of the longest waits of a job, without the time in queues of devices; at most kMaxDuration.
[[nodiscard]] Duration longest_waits(const Task &task);

}  // namespace redag
