// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The started jobs and their threads, for observers that look from time to time.
#include "redag/base/lock_guard.hpp"
#include "redag/engine/engine.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/engine/waiting_jobs.hpp"
#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

/// The thread to which a clock of pthread_getcpuclockid() belongs. Linux and every C library for it agree on this form:
/// the bits above the lowest three are the complement of the thread's number.
int thread_of(clockid_t cpu_clock) { return ~(cpu_clock >> 3); }

}  // namespace

void Engine::started(std::vector<StartedJob> &out) const {
  out.clear();
  out.reserve(2 * std::size_t{pool_.size()});  // mostly enough, which spares an allocation under the lock
  {
    const LockGuard guard(lock_);
    for (const auto &thread : pool_.threads()) {
      for (const Job &job : thread->stack) out.push_back(StartedJob{.job = job, .thread = thread->index});
      if (thread->stack.empty()) continue;
      StartedJob &topmost = out.back();
      topmost.on_top = true;
      // Null, or another job, while the thread is on its way into the job or out of it.
      const RunningJob *running = thread->top.load(std::memory_order_acquire);
      if (running != nullptr && running->slot == topmost.job.slot) topmost.begun = running->begun;
    }
    waiting_.for_each([&](const WaitingJob &job) {
      if (job.thread == nullptr) return;
      out.push_back({.job = job.job, .thread = job.thread->index, .on_top = true, .lends = true, .begun = job.begun});
    });
  }
  for (StartedJob &started : out) {
    if (started.begun == kNever) continue;
    const clockid_t clock = pool_.threads()[started.thread]->cpu_clock;
    started.thread_cpu = cpu_now(clock);
    started.thread_id = thread_of(clock);
  }
}

}  // namespace redag::runtime
