// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A driver whose every step a test takes by hand, without a clock or threads. Keeps what each worker runs, as a real
// driver would, and collects the events.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "redag/sched/scheduler.hpp"

namespace redag::testing {

class ManualWorkers {
 public:
  ManualWorkers(const Workload &workload, std::unique_ptr<sched::Scheduler> scheduler, std::uint32_t workers);

  /// These report what happens at now(); decide() takes the decisions. Tasks are given by name; names must be unique.
  ManualWorkers &release(std::string_view task, Time nominal);
  ManualWorkers &release(std::string_view task) { return release(task, now_); }
  ManualWorkers &finish(std::string_view task, sched::Outcome outcome = sched::Outcome::Finished);
  ManualWorkers &preemption_point(std::string_view task);
  ManualWorkers &decide();
  ManualWorkers &at(Time now);

  /// The jobs by worker: "a b -" for task a on worker 0, b on 1, nothing on 2.
  [[nodiscard]] std::string running() const;
  /// Started jobs that are not running, by task name, sorted.
  [[nodiscard]] std::string suspended() const;

  [[nodiscard]] sched::Scheduler &scheduler() { return *scheduler_; }
  [[nodiscard]] const std::vector<JobEvent> &events() const { return events_; }
  [[nodiscard]] sched::Accounting accounting(std::string_view task) const { return scheduler_->accounting(id(task)); }
  /// Adds a DAG while running.
  DagId add_dag(const Dag &dag);

  [[nodiscard]] TaskId id(std::string_view task) const;

 private:
  struct Started {
    JobSlot job;
    TaskId task;
    WorkerId worker;  // none: suspended
  };
  [[nodiscard]] std::vector<Started>::iterator find(std::string_view task);

  std::unique_ptr<sched::Scheduler> scheduler_;
  std::vector<std::string> names_;
  std::vector<Started> started_;
  std::vector<JobEvent> events_;
  std::uint32_t workers_;
  Time now_ = 0;
};

}  // namespace redag::testing
