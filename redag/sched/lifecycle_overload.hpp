// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The definitions of Lifecycle for budgets and criticality: what happens when a job has used a limit, and HI mode from
// its beginning to its end.
#pragma once

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/sched/lifecycle.hpp"

namespace redag::sched {

// Returns true if both tasks are on one grid: same period and offset, joined by edges. Job k of one can then wait,
// directly or through other tasks, for job k of the other.
[[nodiscard]] inline bool shares_grid(const TaskState &a, const TaskState &b) {
  const bool have_grids = a.on_grid && b.on_grid && b.timer;
  return have_grids && a.joined && b.joined && b.life == TaskLife::Live && a.period == b.period && a.offset == b.offset;
}

template <Dispatcher D>
void Lifecycle<D>::exceed(JobSlot job_slot, Limit limit, Time now) {
  if (!D::kEnforcesLimits) return;
  REDAG_CHECK(table_.has(job_slot) && table_.jobs[job_slot.value].started(), "a job that does not run uses nothing");
  table_.step.begin(now);
  const Job &job = table_.jobs[job_slot.value];
  if (limit == Limit::WcetLow) return enter_high_mode(job);
  table_.step.emit(job, JobEventKind::Exceeded, 0);
  TaskState &task = table_.tasks[job.task.value];
  switch (task.on_budget) {
    case OnBudget::Abort:  // the driver cuts the job off as soon as it can
    case OnBudget::Log: break;
    case OnBudget::Demote: demote(job_slot.value); break;
    case OnBudget::SkipNext:
      if (task.skips_next || !takes_releases(task)) break;
      task.skips_next = true;
      ++owed_skips_;
      refresh_restricted();
      break;
  }
}

template <Dispatcher D>
void Lifecycle<D>::forget_skip(TaskState &task) {
  if (!task.skips_next) return;
  task.skips_next = false;
  --owed_skips_;
  refresh_restricted();
}

// Returns why a release of a live task is refused, or None if it is admitted.
template <Dispatcher D>
Reason Lifecycle<D>::refusal(TaskState &task, Time nominal) {
  if (task.skips_next) {
    forget_skip(task);
    return Reason::Budget;
  }
  const bool taken = !task.degraded || is_let_through(task, nominal);
  return taken ? Reason::None : Reason::Degraded;
}

template <Dispatcher D>
bool Lifecycle<D>::is_let_through(TaskState &task, Time nominal) {
  const DagState &dag = table_.dags[task.dag.value];
  if (!task.timer) return dag.degrade.kind != Degrade::Kind::Stop;
  Time last = task.let_through;
  if (task.joined) {
    // All tasks on one grid share one choice. On its own, each would start from the release that it saw first in HI
    // mode. A job could then wait for ever for a job that the other task skipped.
    for (const TaskId id : dag.tasks) {
      const TaskState &other = table_.tasks[id.value];
      if (shares_grid(task, other)) last = std::max(last, other.let_through);
    }
  }
  if (!lets_through(dag.degrade, task.period, last, nominal)) return false;
  task.let_through = nominal;
  return true;
}

// AMC (Baruah, Burns, Davis, RTSS 2011): from this instant, no job of a DAG of lower criticality delays other jobs.
template <Dispatcher D>
void Lifecycle<D>::enter_high_mode(const Job &cause) {
  if (table_.high_mode || closed_ || table_.dags[table_.task_of(cause).dag.value].degrades()) return;
  table_.high_mode = true;
  refresh_restricted();
  mode_cause_ = cause;
  mode_cause_.worker = WorkerId();
  high_since_ = table_.step.now();
  table_.step.emit(cause, JobEventKind::HighMode, 0);
  for (TaskState &task : table_.tasks) {
    if (task.life == TaskLife::Gone || !table_.dags[task.dag.value].degrades()) continue;
    task.degraded = true;
    task.let_through = kNoRelease;
    task.key = table_.demoted_key(task);
  }
  for (std::uint32_t slot = 0; slot < table_.jobs.size(); ++slot) {
    const Job &job = table_.jobs[slot];
    if (job.state == JobState::Free) continue;
    if (job.started()) {
      // A started job also loses the priority of a job that is skipped now.
      if (table_.tasks[job.task.value].degraded && !job.demoted) {
        demote(slot);
      } else if (table_.tasks[job.priority_of.value].degraded) {
        dispatcher_.on_lowered(slot);
      }
      continue;
    }
    if (!table_.tasks[job.task.value].degraded) continue;
    const bool unused_data = job.state == JobState::Ready && table_.tasks[job.task.value].timer;
    const TaskId task = job.task;
    skip(slot, Reason::Degraded);
    if (unused_data) table_.precedence.give_back(task);
  }
}

// No job is in progress. The degraded DAGs begin afresh: old data is discarded, and jobs that wait for data are
// skipped.
template <Dispatcher D>
void Lifecycle<D>::leave_high_mode() {
  table_.step.emit(mode_cause_, JobEventKind::LowMode, high_since_);
  skip_all(Reason::Degraded, [this](const Job &job) { return table_.tasks[job.task.value].degraded; });
  for (std::uint32_t t = 0; t < table_.tasks.size(); ++t) {
    TaskState &task = table_.tasks[t];
    if (!task.degraded) continue;
    task.degraded = false;
    task.key = task.tier;
    if (task.life == TaskLife::Live) table_.precedence.discard(TaskId(t));
  }
  table_.high_mode = false;
  refresh_restricted();
}

template <Dispatcher D>
void Lifecycle<D>::demote(std::uint32_t slot) {
  if (table_.jobs[slot].demoted) return;
  table_.jobs[slot].demoted = true;
  dispatcher_.on_lowered(slot);
}

}  // namespace redag::sched
