// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Synthetic bodies, which use a given amount of processor time and do nothing else. They stand for a workload's real
// code. Called on the thread that runs the job.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/model/workload.hpp"

namespace redag::lab {

/// Runs until the calling job has used `demand` of its own processor time; preemption does not shorten the work. It
/// uses more only if the machine stalls at the end, and less by at most two readings of the thread's clock. Calls
/// preemption_point() every `region` (0: never). Ends early once `give_up` is set.
void burn(Duration demand, Duration region, const std::atomic<bool> &give_up);

/// Returns one body per task, in TaskId order. Job k of a task uses execution_time(task, id, k, seed), at most the
/// task's budget, and waits as the task does: the devices are simulated, and serve it for wait_time(). `workload` and
/// `give_up` must outlive the bodies.
[[nodiscard]] std::vector<runtime::Body> synthetic_bodies(const Workload &workload, std::uint64_t seed,
                                                          const std::atomic<bool> &give_up);

}  // namespace redag::lab
