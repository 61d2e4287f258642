// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A scheduler that records its calls, for another one to receive the same calls afterwards. The decisions are then
// known without asking the scheduler that took them. It does not record cooperative preemption, and ids must not be
// reused.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::testing {

using JobKey = std::pair<std::uint32_t, std::uint32_t>;  // task, number

/// What had to happen to started jobs from some time on.
struct Decision {
  struct Change {
    JobKey job;
    bool starts = false;      // false: it had started before
    std::uint32_t level = 0;  // 0 is the most urgent
  };
  Time time = 0;     // CLOCK_MONOTONIC: when the decision was requested
  pid_t thread = 0;  // the thread that requested it, and carries it out
  std::vector<Change> changes;
};

class RecordingScheduler final : public sched::Scheduler {
 public:
  /// All calls to a scheduler. Outlives it.
  class Log;

  RecordingScheduler(std::unique_ptr<sched::Scheduler> scheduler, std::shared_ptr<Log> log);
  ~RecordingScheduler() override;

  [[nodiscard]] static std::shared_ptr<Log> make_log();
  /// Returns what `other`, a new scheduler, decides on the same calls. `differences` counts jobs that ended without
  /// having started there.
  [[nodiscard]] static std::vector<Decision> replay(const Log &log, sched::Scheduler &other, std::size_t &differences);

  using Scheduler::release;
  void release(TaskId task, Time nominal, Time now, Time origin) override;
  void miss(TaskId task, Time nominal, Time now, Reason reason) override;
  void complete(JobSlot job, Time now, sched::Outcome outcome) override;
  void preemption_point(JobSlot job, Time now) override;
  void exceed(JobSlot job, sched::Limit limit, Time now) override;
  /// Does nothing: the recorded scheduler's steps keep all events.
  void record_only(sched::EventKinds /*kinds*/) override {}
  [[nodiscard]] bool high_mode() const override { return scheduler_->high_mode(); }
  sched::Step dispatch(Time now, std::uint32_t most) override;
  [[nodiscard]] bool outranked(JobSlot job) const override { return scheduler_->outranked(job); }
  DagId add_dag(const Dag &dag, Time now) override;
  void remove_dag(DagId dag, Time now) override;
  using Scheduler::add_task;
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) override;
  void remove_task(TaskId task, Time now) override;
  void set_timing(TaskId task, Duration period, Duration deadline, Time now) override;
  void close(Time now) override;
  [[nodiscard]] std::span<const TaskId> tasks_of(DagId dag) const override { return scheduler_->tasks_of(dag); }
  [[nodiscard]] std::span<const Device> devices() const override { return scheduler_->devices(); }
  [[nodiscard]] std::size_t task_slots() const override { return scheduler_->task_slots(); }
  [[nodiscard]] std::size_t dag_slots() const override { return scheduler_->dag_slots(); }
  [[nodiscard]] sched::Accounting accounting(TaskId task) const override { return scheduler_->accounting(task); }
  [[nodiscard]] std::uint32_t ready(TaskId task) const override { return scheduler_->ready(task); }
  [[nodiscard]] std::uint32_t level(TaskId task) const override { return scheduler_->level(task); }
  [[nodiscard]] std::uint64_t thread_waits() const override { return scheduler_->thread_waits(); }

 private:
  std::unique_ptr<sched::Scheduler> scheduler_;
  std::shared_ptr<Log> log_;
  std::vector<JobKey> jobs_;  // by slot
};

}  // namespace redag::testing
