// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/coroutine_body.hpp"

#include <stdexcept>
#include <utility>

#include "redag/engine/waiting_jobs.hpp"

namespace redag::runtime {
namespace {

void begin(RunningJob &running, Coroutine body, CoroutineOwner *owner) {
  const Coroutine::Handle handle = body.handle();
  if (!handle) return;
  running.begins_coroutine = true;
  handle.resume();
  running.begins_coroutine = false;
  if (handle.done()) {
    if (handle.promise().exception) std::rethrow_exception(handle.promise().exception);
    return;
  }
  // If there is no memory, the job ends, and does not wait.
  detail::Wait *const wait = std::exchange(running.wait, nullptr);
  if (running.waiting == nullptr) running.waiting = new WaitingJob();
  running.waiting->coroutine = std::move(body);
  running.waiting->owner = owner;
  running.wait = wait;
}

}  // namespace

Body coroutine_body(CoroutineFunction function) {
  return [function = std::move(function)](const Job &job) {
    begin(*RunningJob::current(), function(job), nullptr);
    return sched::Outcome::Finished;
  };
}

void run_in_job(Coroutine coroutine, CoroutineOwner *owner) {
  RunningJob &running = *RunningJob::current();
  const bool waits = running.waiting != nullptr && running.waiting->coroutine.handle();
  if (waits || running.begins_coroutine) {
    throw std::logic_error("a job begins a second coroutine before the first one has ended (let one await the other)");
  }
  begin(running, std::move(coroutine), owner);
}

namespace {

// The coroutine is part of something that can be gone.
[[gnu::noinline]] void resume_with_owner(WaitingJob &job) {
  const std::shared_ptr<void> held = job.owner->hold();
  if (!held) job.wait->cancelled = true;
  job.wait->coroutine.resume();
}

}  // namespace

sched::Outcome go_on(RunningJob &running) {
  WaitingJob &job = *running.waiting;
  const Coroutine::Handle handle = job.coroutine.handle();
  running.owner = job.owner;
  if (job.owner == nullptr) {
    job.wait->coroutine.resume();
  } else {
    resume_with_owner(job);
  }
  if (!handle.done()) return sched::Outcome::Finished;
  const std::exception_ptr exception = handle.promise().exception;
  delete std::exchange(running.waiting, nullptr);
  if (exception) std::rethrow_exception(exception);
  return sched::Outcome::Finished;
}

}  // namespace redag::runtime
