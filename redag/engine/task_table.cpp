// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/task_table.hpp"

#include <algorithm>
#include <utility>

#include "redag/base/check.hpp"

namespace redag::runtime {

void TaskEntry::set_limits(const Task &task) {
  wcet = task.wcet;
  wcet_low = task.wcet_low;
  budget = task.budget;
  cuts_off = task.on_budget == OnBudget::Abort;
  always_measured = wcet_low > 0 || budget > 0 || (wcet > 0 && wcet < CpuMeter::kShort);
  const auto or_never = [](Duration limit) { return limit > 0 ? limit : kNever; };
  first_limit = std::min(or_never(wcet_low), or_never(budget));
  least_limit = std::min(or_never(wcet), or_never(budget));
}

void TaskTable::add(TaskId id, const Task &task, const TaskRole &role, Body &body,
                    std::shared_ptr<SkipListener> listener) {
  REDAG_CHECK(id.value <= entries_.size(), "the scheduler numbers tasks differently");
  if (id.value == entries_.size()) entries_.push_back(std::make_unique<TaskEntry>());
  TaskEntry &entry = *entries_[id.value];
  REDAG_CHECK(!entry.body && entry.busy == 0, "a task that is still there is replaced");
  most_started_ += task.concurrency;
  most_started_ -= entry.concurrency;
  entry = TaskEntry{};
  entry.body.swap(body);
  entry.listener = std::move(listener);
  entry.set_limits(task);
  entry.period = task.period;
  entry.deadline = task.deadline;
  if (role.is_sink && role.dag_deadline > 0) entry.dag_deadline = role.dag_deadline;
  if (measure_) {
    entry.response = std::make_shared<Histogram>();
    entry.execution = std::make_shared<Histogram>();
    if (role.is_sink) entry.end_to_end = role.has_predecessors ? std::make_shared<Histogram>() : entry.response;
  }
  entry.concurrency = task.concurrency;
  entry.is_special = logs_misses_ || entry.first_limit != kNever || entry.dag_deadline != kNever;
}

void TaskTable::remove(TaskId id, std::vector<Body> &doomed) {
  REDAG_CHECK(id.value < entries_.size(), "removal of a task that does not exist");
  TaskEntry &entry = *entries_[id.value];
  entry.removed = entry.is_special = true;
  entry.listener.reset();
  if (entry.busy == 0) doomed.emplace_back().swap(entry.body);
}

}  // namespace redag::runtime
