// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How many jobs of a workload can be in progress at once. Pure functions.
#pragma once

#include <cstdint>

#include "redag/model/workload.hpp"

namespace redag {

/// Jobs that can be started and unfinished at once under full preemption: no more than `concurrency` of a task,
/// `max_active` of a DAG, and one of a group. Never too small; too large only where tasks of one group are in several
/// DAGs of which some have a `max_active`.
[[nodiscard]] std::uint64_t most_started(const Workload &workload);

}  // namespace redag
