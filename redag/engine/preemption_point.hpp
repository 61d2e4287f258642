// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Functions that a job's body may call about itself: a preemption point, and its own processor time. Outside a job they
// do nothing. Call them on the thread that runs the job.
#pragma once

#include "redag/base/time.hpp"

namespace redag {

/// Lets a more urgent job run now on top of the caller's stack, and returns when that job has ended (preemption:
/// cooperative). Costs one relaxed atomic load while no job is more urgent; a task with a limit also pays for reading
/// its processor time. Do not call it while holding a lock that other jobs take: the job on top would wait for ever.
/// Throws BudgetExceeded, in all modes, if the job has used more than its budget and `on_budget` is abort. Let it pass.
void preemption_point();

/// Processor time that the current job has used, without jobs on top of it; 0 outside a job.
[[nodiscard]] Duration job_cpu_time();

/// Ends a job from within (see preemption_point). It is not a std::exception, so that it passes a body's own handlers.
struct BudgetExceeded {};

}  // namespace redag
