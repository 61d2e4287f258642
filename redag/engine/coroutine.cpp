// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/coroutine.hpp"

#include "redag/base/check.hpp"
#include "redag/engine/frame_pool.hpp"
#include "redag/engine/running_job.hpp"

namespace redag::runtime::detail {

void Wait::suspend(std::coroutine_handle<> its_coroutine) noexcept {
  RunningJob *const running = RunningJob::current();
  REDAG_CHECK(running != nullptr, "a coroutine waits that no engine runs");
  REDAG_CHECK(!running->blocks, "a coroutine waits inside a redag::Blocking");
  coroutine = its_coroutine;
  engine = running->engine;
  job = running->job.slot;
  cancelled = timed_out = is_over = false;  // it may be awaited again
  exception = nullptr;
  running->wait = this;
}

void Wait::resume() const {
  if (cancelled) throw WaitCancelled{};
  if (exception) std::rethrow_exception(exception);
}

void *allocate_frame(std::size_t size) { return take_storage(size); }
void free_frame(void *frame, std::size_t size) noexcept { give_back_storage(frame, size); }

}  // namespace redag::runtime::detail
