// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/synthetic.hpp"

#include <algorithm>
#include <chrono>
#include <thread>

#include "redag/base/relax.hpp"
#include "redag/derived/demand.hpp"
#include "redag/derived/waits.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/device_handle.hpp"
#include "redag/threads/clock.hpp"

namespace redag::lab {
namespace {

// Returns the cost of reading the thread's clock, which is a system call: the least of several readings.
Duration reading_cost() {
  static const Duration kCost = [] {
    Duration least = kNever;
    Duration before = runtime::thread_cpu_now();
    for (int i = 0; i < 32; ++i) {
      const Duration now = runtime::thread_cpu_now();
      least = std::min(least, now - before);
      before = now;
    }
    return std::max<Duration>(least, 1);
  }();
  return kCost;
}

// Spins for `time` on a clock that needs no system call. A preemption shortens the processor time of the spin and
// never lengthens it.
void spin_for(Duration time, const std::atomic<bool> &give_up) {
  const Time end = runtime::monotonic_now() + time;
  while (runtime::monotonic_now() < end && !give_up.load(std::memory_order_relaxed)) relax();
}

// What a simulated device does while it serves a job: nothing, for `length`.
void serve_for(Duration length, const std::atomic<bool> &give_up) {
  constexpr Duration kLook = 10 * kMillisecond;
  const Time end = runtime::monotonic_now() + length;
  for (Time now = end - length; now < end && !give_up.load(std::memory_order_relaxed); now = runtime::monotonic_now()) {
    std::this_thread::sleep_for(std::chrono::nanoseconds(std::min(end - now, kLook)));
  }
}

// A job of a task with waits. Its arguments live in its frame, and so outlast its waits.
Coroutine waiting_job(const Task &task, TaskId id, std::uint32_t number, std::uint64_t seed,
                      const std::atomic<bool> &give_up) {
  const Duration demand = execution_time(task, id, number, seed);
  const bool cut_off = task.on_budget == OnBudget::Abort && task.budget > 0 && demand > task.budget;
  const Duration end = cut_off ? task.budget : demand;
  for (std::size_t wait = 0; wait < task.waits.size() && wait_point(task, wait, demand) < end; ++wait) {
    burn(wait_point(task, wait, demand), task.region, give_up);
    const Duration length = wait_time(task, id, number, wait, seed);
    if (const DeviceId device = task.waits[wait].device; device.valid()) {
      const runtime::DeviceHandle handle(*runtime::RunningJob::current()->engine, device);
      co_await handle.run([length, &give_up] { serve_for(length, give_up); });
    } else {
      co_await sleep_for(std::chrono::nanoseconds(length));
    }
  }
  burn(end, task.region, give_up);
  if (cut_off) throw BudgetExceeded{};
}

}  // namespace

void burn(Duration demand, Duration region, const std::atomic<bool> &give_up) {
  // The reading that finds the end and the engine's own reading after it are also charged to the job.
  const Duration enough = demand - 2 * reading_cost();
  Duration used = job_cpu_time();
  Duration next_point = region > 0 ? (used / region + 1) * region : kNever;
  for (; used < enough; used = job_cpu_time()) {
    if (give_up.load(std::memory_order_relaxed)) return;
    if (used >= next_point) {
      preemption_point();
      next_point += region;
      continue;
    }
    spin_for(std::min(enough, next_point) - used, give_up);
  }
}

std::vector<runtime::Body> synthetic_bodies(const Workload &workload, std::uint64_t seed,
                                            const std::atomic<bool> &give_up) {
  (void)reading_cost();  // measures the cost here rather than in a job
  std::vector<runtime::Body> bodies;
  for (const TaskRef &ref : flatten(workload)) {
    if (!ref.task->waits.empty()) {
      bodies.push_back(runtime::coroutine_body([task = ref.task, id = ref.id, seed, &give_up](const runtime::Job &job) {
        return waiting_job(*task, id, job.number, seed, give_up);
      }));
      continue;
    }
    // An engine of a cluster knows the task by another id than the workload does.
    bodies.emplace_back([task = ref.task, id = ref.id, seed, &give_up](const runtime::Job &job) {
      const Duration demand = execution_time(*task, id, job.number, seed);
      const bool cut_off = task->on_budget == OnBudget::Abort && task->budget > 0 && demand > task->budget;
      burn(cut_off ? task->budget : demand, task->region, give_up);
      return cut_off ? sched::Outcome::BudgetExceeded : sched::Outcome::Finished;
    });
  }
  return bodies;
}

}  // namespace redag::lab
