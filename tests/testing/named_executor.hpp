// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Drives a scheduler by the names of tasks, for tests of which job runs next.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/testing/builders.hpp"

#include "redag_analysis/executors/executors.hpp"

namespace redag::testing {

inline Task timer(std::string name, Duration period = 10) { return tick_task({std::move(name), period}); }

inline Task subscription(std::string name, std::vector<std::uint32_t> after) {
  return tick_task({std::move(name), 0, 1, std::move(after)});
}

/// Drives an executor by the names of tasks. Time is always 0: only the order of events matters.
class NamedExecutor {
 public:
  using Names = std::vector<std::string>;

  NamedExecutor(std::string_view executor, std::vector<std::vector<Task>> dags, std::uint32_t workers,
                std::vector<std::uint32_t> ranks = {}) {
    for (std::vector<Task> &tasks : dags) {
      Dag dag;
      dag.tasks = std::move(tasks);
      dag.max_active = 1;  // these executors do not know it
      inherit_periods(dag);
      workload_.dags.push_back(dag);
    }
    for (const TaskRef &ref : flatten(workload_)) names_.push_back(ref.task->name);
    sched::Config config;
    config.workers = workers;
    scheduler_ = executors::make_scheduler(executor, workload_, config, std::move(ranks));
  }

  void release(const std::string &name) {
    const TaskId task = id(name);
    const Duration period = flatten(workload_)[task.value].task->period;
    scheduler_->release(task, period * releases_[name]++, 0);
  }

  /// Dispatches, and returns the tasks whose jobs start.
  Names dispatch() {
    Names started;
    for (const sched::Dispatch &d : scheduler_->dispatch(0).dispatches) {
      started.push_back(names_[d.task.value]);
      running_[started.back()] = d.job;
    }
    return started;
  }

  Names end(const std::string &name, sched::Outcome outcome = sched::Outcome::Finished) {
    scheduler_->complete(running_.at(name), 0, outcome);
    running_.erase(name);
    return dispatch();
  }

  Names release_and_dispatch(const Names &names) {
    for (const std::string &name : names) release(name);
    return dispatch();
  }

  [[nodiscard]] sched::Accounting accounting(const std::string &name) const { return scheduler_->accounting(id(name)); }
  void remove_dag(std::size_t dag) { scheduler_->remove_dag(DagId(dag), 0); }

 private:
  [[nodiscard]] TaskId id(const std::string &name) const {
    return TaskId(static_cast<std::size_t>(std::find(names_.begin(), names_.end(), name) - names_.begin()));
  }

  Workload workload_;
  Names names_;
  std::unique_ptr<sched::Scheduler> scheduler_;
  std::map<std::string, Time> releases_;
  std::map<std::string, JobSlot> running_;
};

}  // namespace redag::testing
