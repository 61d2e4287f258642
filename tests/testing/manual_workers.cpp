// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/manual_workers.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "redag/base/check.hpp"

namespace redag::testing {

ManualWorkers::ManualWorkers(const Workload &workload, std::unique_ptr<sched::Scheduler> scheduler,
                             std::uint32_t workers)
    : scheduler_(std::move(scheduler)), workers_(workers) {
  for (const TaskRef &ref : flatten(workload)) names_.push_back(ref.task->name);
}

ManualWorkers &ManualWorkers::release(std::string_view task, Time nominal) {
  scheduler_->release(id(task), nominal, now_);
  return *this;
}

ManualWorkers &ManualWorkers::finish(std::string_view task, sched::Outcome outcome) {
  const auto started = find(task);
  const JobSlot job = started->job;
  started_.erase(started);
  scheduler_->complete(job, now_, outcome);
  return *this;
}

ManualWorkers &ManualWorkers::preemption_point(std::string_view task) {
  scheduler_->preemption_point(find(task)->job, now_);
  return *this;
}

ManualWorkers &ManualWorkers::decide() {
  const sched::Step step = scheduler_->dispatch(now_);
  for (const sched::Dispatch &dispatch : step.dispatches) {
    for (Started &other : started_) {
      if (dispatch.over.valid() && other.job == dispatch.over) other.worker = WorkerId();
    }
    const auto known =
        std::find_if(started_.begin(), started_.end(), [&](const Started &s) { return s.job == dispatch.job; });
    const bool starts = dispatch.kind == sched::DispatchKind::Start;
    REDAG_CHECK((known == started_.end()) == starts, "a job is started once and then resumed");
    if (starts) {
      started_.push_back({dispatch.job, dispatch.task, dispatch.worker});
    } else if (dispatch.kind == sched::DispatchKind::Resume) {
      known->worker = dispatch.worker;
    }
  }
  events_.insert(events_.end(), step.events.begin(), step.events.end());
  return *this;
}

ManualWorkers &ManualWorkers::at(Time now) {
  now_ = now;
  return *this;
}

std::string ManualWorkers::running() const {
  std::vector<std::string> shown(workers_, "-");
  for (const Started &started : started_) {
    if (!started.worker.valid()) continue;
    REDAG_CHECK(shown.at(started.worker.value) == "-", "two jobs run on one worker");
    shown[started.worker.value] = names_[started.task.value];
  }
  std::string text;
  for (const std::string &name : shown) text += (text.empty() ? "" : " ") + name;
  return text;
}

std::string ManualWorkers::suspended() const {
  std::multiset<std::string> names;
  for (const Started &started : started_) {
    if (!started.worker.valid()) names.insert(names_[started.task.value]);
  }
  std::string text;
  for (const std::string &name : names) text += (text.empty() ? "" : " ") + name;
  return text;
}

DagId ManualWorkers::add_dag(const Dag &dag) {
  for (const Task &task : dag.tasks) names_.push_back(task.name);
  return scheduler_->add_dag(dag, now_);
}

TaskId ManualWorkers::id(std::string_view task) const {
  const auto found = std::find(names_.begin(), names_.end(), task);
  REDAG_CHECK(found != names_.end(), "no task of that name");
  return TaskId(static_cast<std::size_t>(found - names_.begin()));
}

std::vector<ManualWorkers::Started>::iterator ManualWorkers::find(std::string_view task) {
  const auto found =
      std::find_if(started_.begin(), started_.end(), [&](const Started &s) { return names_[s.task.value] == task; });
  REDAG_CHECK(found != started_.end(), "no started job of that task");
  return found;
}

}  // namespace redag::testing
