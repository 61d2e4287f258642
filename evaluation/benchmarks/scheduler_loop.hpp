// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shared by the benchmarks of the scheduler: a workload of many independent tasks, and a loop that runs jobs through
// the scheduler.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "redag/derived/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"

namespace redag::benchmarks {

// Returns `count` independent timer tasks in DAGs of ten, with periods from 1 ms to 1 s.
inline Workload make_workload(std::size_t count, std::uint32_t workers, std::uint32_t max_active) {
  Workload workload;
  workload.platform = {workers, PreemptionMode::Os};
  Rng rng(1);
  for (std::size_t i = 0; i < count; ++i) {
    if (i % 10 == 0) {
      workload.dags.emplace_back();
      workload.dags.back().max_active = max_active;
    }
    Task task;
    task.period = rng.uniform(1, 1000) * kMillisecond;
    task.deadline = task.period;
    task.wcet = static_cast<Duration>(0.7 * workers * static_cast<double>(task.period) / static_cast<double>(count));
    workload.dags.back().tasks.push_back(task);
  }
  return workload;
}

/// Keeps 4 jobs running. Each step ends one and releases one. About half of the tasks have a ready job.
class SchedulerLoop {
 public:
  SchedulerLoop(std::size_t tasks, sched::Preemption preemption, std::uint32_t max_active)
      : scheduler_(make_workload(tasks, kWorkers, max_active), {kWorkers, preemption, PolicyKind::RateMonotonic, 0, 0}),
        order_(std::size_t{1} << 16U) {
    Rng rng(7);
    const auto last = static_cast<std::int64_t>(tasks) - 1;
    for (TaskId &task : order_) task = TaskId(static_cast<std::uint32_t>(rng.uniform(0, last)));
    for (std::size_t i = 0; i < tasks / 2 + kWorkers; ++i) scheduler_.release(order_[i], now_, now_);
    carry_out(scheduler_.dispatch(now_));
  }

  /// Releases a job and decides, then completes a running job and decides again.
  void step() {
    ++now_;
    scheduler_.release(order_[steps_ % order_.size()], now_, now_);
    carry_out(scheduler_.dispatch(now_));
    JobSlot &job = running_[steps_ % kWorkers];
    if (job.valid()) {
      const JobSlot ended = job;
      job = JobSlot();
      scheduler_.complete(ended, now_, sched::Outcome::Finished);
      carry_out(scheduler_.dispatch(now_));
    }
    ++steps_;
  }

 private:
  static constexpr std::uint32_t kWorkers = 4;

  void carry_out(const sched::Step &step) {
    for (const auto &dispatch : step.dispatches) running_[dispatch.worker.value] = dispatch.job;
  }

  sched::PriorityScheduler scheduler_;
  std::vector<TaskId> order_;
  std::vector<JobSlot> running_ = std::vector<JobSlot>(kWorkers);
  Time now_ = 0;
  std::size_t steps_ = 0;
};

}  // namespace redag::benchmarks
