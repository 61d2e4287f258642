// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies of the engine that are coroutines: how a job's coroutine begins, and goes on after each wait. Called on the
// thread that runs the job.
#pragma once

#include <functional>

#include "redag/runtime/coroutine.hpp"
#include "redag/runtime/job_body.hpp"
#include "redag/runtime/running_job.hpp"

namespace redag::runtime {

using CoroutineFunction = std::function<Coroutine(const Job &)>;

/// A body that runs the coroutine which `function` returns, until its first wait. The function outlives the job, and
/// so do the captures of a lambda. Its arguments do not.
[[nodiscard]] Body coroutine_body(CoroutineFunction function);

/// Runs the job's coroutine until its next wait or its end. Throws what the body throws.
[[nodiscard]] sched::Outcome go_on(RunningJob &running);

}  // namespace redag::runtime
