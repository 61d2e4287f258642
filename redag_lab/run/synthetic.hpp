// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies that use a given amount of processor time and nothing else: jobs of a workload without its real code. Called
// on the thread that runs the job.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/runtime/engine.hpp"

namespace redag::runtime {

/// Uses `demand` of the calling job's own processor time, so that being preempted does not shorten its work: not more,
/// unless the machine stalls at the end, and less by the cost of two readings of the thread's clock at most. Calls
/// preemption_point() every `region` (0: never). Ends early once `give_up` is set.
void burn(Duration demand, Duration region, const std::atomic<bool> &give_up);

/// One body a task, in TaskId order. Job k of a task asks for execution_time(task, id, k, seed); it is cut off at the
/// task's budget. `workload` and `give_up` must outlive the bodies.
[[nodiscard]] std::vector<Body> synthetic_bodies(const Workload &workload, std::uint64_t seed,
                                                 const std::atomic<bool> &give_up);

}  // namespace redag::runtime
