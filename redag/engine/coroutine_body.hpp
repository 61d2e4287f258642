// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies of the engine that are coroutines: how a job's coroutine begins, and goes on after each wait. Called on the
// thread that runs the job.
#pragma once

#include <functional>
#include <memory>

#include "redag/engine/coroutine.hpp"
#include "redag/engine/job_body.hpp"
#include "redag/engine/running_job.hpp"

namespace redag::runtime {

/// Whose coroutine a job runs, if it is part of something that can be gone before the coroutine ends. Asked on the
/// job's thread each time that the coroutine is to go on.
class CoroutineOwner {
 public:
  virtual ~CoroutineOwner() = default;
  /// Returns what is to live until the coroutine waits again or ends. Null: what the coroutine uses is gone, and its
  /// wait counts as cancelled.
  [[nodiscard]] virtual std::shared_ptr<void> hold() = 0;
};

using CoroutineFunction = std::function<Coroutine(const Job &)>;

/// A body that runs the coroutine which `function` returns, until its first wait. The function outlives the job, and
/// so do the captures of a lambda. Its arguments do not.
[[nodiscard]] Body coroutine_body(CoroutineFunction function);

/// Called in the body of a job: runs `coroutine` until its first wait. If it has not ended then, the job goes on with
/// it once the body has returned. Throws what leaves the coroutine until then, and std::logic_error if the job has such
/// a coroutine already. `owner` outlives the coroutine.
void run_in_job(Coroutine coroutine, CoroutineOwner *owner = nullptr);

/// Runs the job's coroutine until its next wait or its end. Throws what the body throws.
[[nodiscard]] sched::Outcome go_on(RunningJob &running);

}  // namespace redag::runtime
