// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a job's body may call about itself: a preemption point, and its own processor time. Free functions; outside a
// job they do nothing. Called from the thread that runs the job.
#pragma once

#include "redag/base/time.hpp"

namespace redag {

/// Lets a more urgent job run now, on top of the caller's stack, and returns when that has ended (preemption:
/// cooperative). Costs one relaxed atomic load while nothing is more urgent; a task with a budget also pays for a look
/// at its processor time. Do not call it while holding a lock that other jobs take: the job on top would wait for
/// itself. Throws BudgetExceeded if the job's processor time exceeds its task's budget and `on_budget` is abort (all
/// modes): let it pass.
void preemption_point();

/// Processor time the current job has used, jobs on top of it not counted; 0 outside a job.
[[nodiscard]] Duration job_cpu_time();

/// Ends a job from within (see preemption_point). Not a std::exception, so that a body's own handlers let it pass.
struct BudgetExceeded {};

}  // namespace redag
