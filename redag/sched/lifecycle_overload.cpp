// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Budgets and criticality: what happens when a job has used a limit, and HI mode from its beginning to its end.
#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/sched/lifecycle.hpp"

namespace redag::sched {

void Lifecycle::exceed(JobSlot job_slot, Limit limit, Time now) {
  REDAG_CHECK(job_slot.value < jobs_.size() && jobs_[job_slot.value].started(), "a job that does not run uses nothing");
  begin(now);
  const Job &job = jobs_[job_slot.value];
  if (limit == Limit::WcetLow) return enter_high_mode(job);
  emit(job, JobEventKind::Exceeded, 0);
  TaskState &task = tasks_[job.task.value];
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

void Lifecycle::forget_skip(TaskState &task) {
  if (!task.skips_next) return;
  task.skips_next = false;
  --owed_skips_;
  refresh_restricted();
}

// Returns why a release of a live task is refused, or None if it is admitted.
Reason Lifecycle::refusal(TaskState &task, Time nominal) {
  if (task.skips_next) {
    forget_skip(task);
    return Reason::Budget;
  }
  const bool taken = !task.degraded || is_let_through(task, nominal);
  return taken ? Reason::None : Reason::Degraded;
}

bool Lifecycle::is_let_through(TaskState &task, Time nominal) {
  const DagState &dag = dag_states_[task.dag.value];
  if (!task.timer) return dag.degrade.kind != Degrade::Kind::Stop;
  Time last = task.let_through;
  if (task.joined) {
    // All tasks on one grid share one choice. On its own, each would start from the release that it saw first in HI
    // mode. A job could then wait for ever for a job that the other task skipped.
    for (const TaskId id : dag.tasks) {
      const TaskState &other = tasks_[id.value];
      if (shares_grid(task, other)) last = std::max(last, other.let_through);
    }
  }
  if (!lets_through(dag.degrade, task.period, last, nominal)) return false;
  task.let_through = nominal;
  return true;
}

// Returns true if both tasks are on one grid: same period and offset, joined by edges. Job k of one can then wait,
// directly or through other tasks, for job k of the other.
bool Lifecycle::shares_grid(const TaskState &a, const TaskState &b) {
  return a.joined && b.joined && b.timer && b.life == TaskLife::Live && a.period == b.period && a.offset == b.offset;
}

// AMC (Baruah, Burns, Davis, RTSS 2011): from this instant, no job of a DAG of lower criticality delays other jobs.
void Lifecycle::enter_high_mode(const Job &cause) {
  if (high_mode_ || closed_ || degrades(dag_states_[tasks_[cause.task.value].dag.value])) return;
  high_mode_ = true;
  refresh_restricted();
  has_post_dispatch_work_ = true;
  mode_cause_ = cause;
  mode_cause_.worker = WorkerId();
  high_since_ = now_;
  emit(cause, JobEventKind::HighMode, 0);
  for (TaskState &task : tasks_) {
    if (task.life == TaskLife::Gone || !degrades(dag_states_[task.dag.value])) continue;
    task.degraded = true;
    task.let_through = kNoRelease;
    task.key = demoted_key(task);
  }
  for (std::uint32_t slot = 0; slot < jobs_.size(); ++slot) {
    const Job &job = jobs_[slot];
    if (job.state == JobState::Free) continue;
    if (job.started()) {
      // A started job also loses the priority of a job that is skipped now.
      if (tasks_[job.task.value].degraded && !job.demoted) {
        demote(slot);
      } else if (tasks_[job.priority_of.value].degraded) {
        on_lowered(slot);
      }
      continue;
    }
    if (!tasks_[job.task.value].degraded) continue;
    const bool unused_data = job.state == JobState::Ready && tasks_[job.task.value].timer;
    const TaskId task = job.task;
    skip(slot, Reason::Degraded);
    if (unused_data) precedence_.give_back(task);
  }
}

// No job is in progress. The degraded DAGs begin afresh: old data is discarded, and jobs that wait for data are
// skipped.
void Lifecycle::restore() {
  emit(mode_cause_, JobEventKind::LowMode, high_since_);
  skip_all(Reason::Degraded, [this](const Job &job) { return tasks_[job.task.value].degraded; });
  for (std::uint32_t t = 0; t < tasks_.size(); ++t) {
    TaskState &task = tasks_[t];
    if (!task.degraded) continue;
    task.degraded = false;
    task.key = task.tier;
    if (task.life == TaskLife::Live) precedence_.discard(TaskId(t));
  }
  high_mode_ = false;
  refresh_restricted();
}

void Lifecycle::demote(std::uint32_t slot) {
  if (jobs_[slot].demoted) return;
  jobs_[slot].demoted = true;
  on_lowered(slot);
}

std::int64_t Lifecycle::own_key(const Job &job) const {
  const TaskState &task = tasks_[job.task.value];
  if (job.demoted || task.degraded) return demoted_key(task);
  return is_static(config_.policy) ? task.tier : job.deadline;
}

// The key of the task's demoted jobs: after all other jobs, and among themselves in the order of tiers.
std::int64_t Lifecycle::demoted_key(const TaskState &task) const {
  return is_static(config_.policy) ? std::int64_t{tier_count_} + task.tier : kDemotedKey;
}

}  // namespace redag::sched
