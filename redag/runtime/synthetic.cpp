#include "redag/runtime/synthetic.hpp"

#include <algorithm>

#include "redag/model/demand.hpp"
#include "redag/runtime/preemption_point.hpp"

namespace redag::runtime {
namespace {

// About a microsecond between two looks at the clock, which is a system call.
void spin_briefly() {
  for (int i = 0; i < 400; ++i) asm volatile("" ::: "memory");
}

}  // namespace

void burn(Duration demand, Duration region, const std::atomic<bool> &give_up) {
  Duration next_point = region > 0 ? region : kNever;
  for (Duration used = job_cpu_time(); used < demand; used = job_cpu_time()) {
    if (give_up.load(std::memory_order_relaxed)) return;
    if (used >= next_point) {
      preemption_point();
      next_point += region;
    }
    spin_briefly();
  }
}

std::vector<Body> synthetic_bodies(const Workload &workload, std::uint64_t seed, const std::atomic<bool> &give_up) {
  std::vector<Body> bodies;
  for (const TaskRef &ref : flatten(workload)) {
    bodies.emplace_back([task = ref.task, seed, &give_up](const Job &job) {
      const Duration demand = execution_time(*task, job.task, job.number, seed);
      const bool cut_off = task->on_budget == OnBudget::Abort && task->budget > 0 && demand > task->budget;
      burn(cut_off ? task->budget : demand, task->region, give_up);
      return cut_off ? sched::Outcome::BudgetExceeded : sched::Outcome::Finished;
    });
  }
  return bodies;
}

}  // namespace redag::runtime
