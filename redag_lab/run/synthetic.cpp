// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/synthetic.hpp"

#include <algorithm>

#include "redag/base/relax.hpp"
#include "redag/model/demand.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/preemption_point.hpp"

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

}  // namespace

void burn(Duration demand, Duration region, const std::atomic<bool> &give_up) {
  // The reading that finds the end and the engine's own reading after it are also charged to the job.
  const Duration enough = demand - 2 * reading_cost();
  Duration next_point = region > 0 ? region : kNever;
  for (Duration used = job_cpu_time(); used < enough; used = job_cpu_time()) {
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
