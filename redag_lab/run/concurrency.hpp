// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds the number of jobs of a workload that can be in progress at once. Pure functions.
#pragma once

#include <cstdint>

#include "redag/model/workload.hpp"

namespace redag::lab {

/// Returns the number of jobs that can be started and unfinished at once under full preemption. These are at most
/// `concurrency` of a task, `max_active` of a DAG, and one of a group. The number is never too small. It is too large
/// only where a group's tasks are in several DAGs, some with a `max_active`.
[[nodiscard]] std::uint64_t most_started(const Workload &workload);

}  // namespace redag::lab
