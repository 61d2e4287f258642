// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/coroutine_body.hpp"

#include <utility>

#include "redag/runtime/waiting_jobs.hpp"

namespace redag::runtime {
namespace {

sched::Outcome begin(RunningJob &running, Coroutine body) {
  const Coroutine::Handle handle = body.handle();
  if (!handle) return sched::Outcome::Finished;
  handle.resume();
  if (handle.done()) {
    if (handle.promise().exception) std::rethrow_exception(handle.promise().exception);
    return sched::Outcome::Finished;
  }
  // If there is no memory, the job ends, and does not wait.
  detail::Wait *const wait = std::exchange(running.wait, nullptr);
  if (running.waiting == nullptr) running.waiting = new WaitingJob();
  running.waiting->coroutine = std::move(body);
  running.wait = wait;
  return sched::Outcome::Finished;
}

}  // namespace

Body coroutine_body(CoroutineFunction function) {
  return [function = std::move(function)](const Job &job) { return begin(*RunningJob::current(), function(job)); };
}

sched::Outcome go_on(RunningJob &running) {
  const Coroutine::Handle handle = running.waiting->coroutine.handle();
  running.waiting->wait->coroutine.resume();
  if (!handle.done()) return sched::Outcome::Finished;
  const std::exception_ptr exception = handle.promise().exception;
  delete std::exchange(running.waiting, nullptr);
  if (exception) std::rethrow_exception(exception);
  return sched::Outcome::Finished;
}

}  // namespace redag::runtime
