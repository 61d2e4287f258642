// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's tasks: adds, changes and removes them while jobs run. Reports their counts, and the started jobs.
#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/engine/engine.hpp"
#include "redag/engine/engine_locked.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/engine/waiting_jobs.hpp"
#include "redag/threads/clock.hpp"
#include "redag/trace/tap.hpp"

namespace redag::runtime {
namespace {

/// The thread to which a clock of pthread_getcpuclockid() belongs. Linux and every C library for it agree on this form:
/// the bits above the lowest three are the complement of the thread's number.
int thread_of(clockid_t cpu_clock) { return ~(cpu_clock >> 3); }

}  // namespace

void Engine::bind(const Workload &workload, std::vector<Body> bodies) {
  REDAG_CHECK(bodies.size() == workload.task_count(), "every task needs a body");
  Locked locked(*this);
  std::vector<TaskId> ids;
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    const Dag &dag = workload.dags[d];
    const std::size_t first = ids.size();
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) ids.emplace_back(first + i);
    register_dag(DagId(d), dag, std::span(ids).subspan(first), std::span(bodies).subspan(first, dag.tasks.size()));
  }
  order_.tasks_changed();
}

AddedDag Engine::add_dag(const Dag &dag, std::vector<Body> bodies) {
  REDAG_CHECK(bodies.size() == dag.tasks.size(), "every task needs a body");
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  AddedDag added;
  added.dag = scheduler_->add_dag(dag, at);
  const std::span<const TaskId> tasks = scheduler_->tasks_of(added.dag);
  added.tasks.assign(tasks.begin(), tasks.end());
  register_dag(added.dag, dag, added.tasks, bodies);
  dag_deadlines_.resize(std::max<std::size_t>(dag_deadlines_.size(), added.dag.value + 1));
  dag_deadlines_[added.dag.value] = dag.deadline;
  order_.tasks_changed();
  decide(locked, at);
  return added;
}

std::vector<TaskId> Engine::add_tasks(std::vector<NewTask> tasks) {
  std::vector<TaskId> ids;
  ids.reserve(tasks.size());
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  for (NewTask &one : tasks) {
    const bool more = &one != &tasks.back();
    ids.push_back(scheduler_->add_task(one.dag, one.rank, one.task, at, more));
    // Its jobs can carry older data. Only the caller knows what follows the task.
    const TaskRole role{.dag = one.dag,
                        .is_sink = true,
                        .has_predecessors = true,
                        .dag_deadline = one.dag.value < dag_deadlines_.size() ? dag_deadlines_[one.dag.value] : 0};
    register_task(ids.back(), one.task, role, one.body, std::move(one.listener));
  }
  order_.tasks_changed();
  decide(locked, at);
  return ids;
}

void Engine::remove_dag(DagId dag) {
  std::vector<Body> doomed;  // destroyed without the lock: destructors are the user's code
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  REDAG_CHECK(dag.value < scheduler_->dag_slots(), "removal of a DAG that does not exist");
  for (const TaskId task : scheduler_->tasks_of(dag)) tasks_.remove(task, doomed);
  scheduler_->remove_dag(dag, at);
  order_.tasks_changed();
  decide(locked, at);
}

void Engine::remove_task(TaskId task) {
  std::vector<Body> doomed;
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  tasks_.remove(task, doomed);
  tasks_[task].waits_end = true;
  scheduler_->remove_task(task, at);
  order_.tasks_changed();
  waiting_.cancel(task);
  decide(locked, at);
}

void Engine::set_predecessors(TaskId task, std::span<const TaskId> predecessors) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  scheduler_->set_predecessors(task, predecessors, at);
  decide(locked, at);
}

void Engine::set_timing(TaskId task, Duration period, Duration deadline) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting(locked);
  scheduler_->set_timing(task, period, deadline, at);
  tasks_[task].period = period;
  tasks_[task].deadline = deadline;
  settled_ = at;
  order_.tasks_changed();
  decide(locked, at);
}

std::optional<Time> Engine::settled() const {
  const LockGuard guard(lock_);
  return settled_;
}

void Engine::register_dag(DagId id, const Dag &dag, std::span<const TaskId> ids, std::span<Body> bodies) {
  std::vector<bool> has_successor(dag.tasks.size());
  for (const Task &task : dag.tasks) {
    for (const std::uint32_t predecessor : task.predecessors) has_successor[predecessor] = true;
  }
  for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
    const TaskRole role{.dag = id,
                        .is_sink = !has_successor[i],
                        .has_predecessors = !dag.tasks[i].predecessors.empty(),
                        .dag_deadline = dag.deadline};
    register_task(ids[i], dag.tasks[i], role, bodies[i]);
  }
}

void Engine::register_task(TaskId id, const Task &task, const TaskRole &role, Body &body,
                           std::shared_ptr<SkipListener> listener) {
  if (listener != nullptr) has_listeners_.store(true, std::memory_order_relaxed);
  tasks_.add(id, task, role, body, std::move(listener));
  if (const trace::Tap *const tap = trace::tap(); tap != nullptr) tap->task(this, id, role.dag, task);
  for (const auto &thread : pool_.threads()) thread->stack.reserve(tasks_.most_started());
  waiting_.reserve(tasks_.most_started());
}

TaskFigures Engine::figures(TaskId task) const {
  const LockGuard guard(lock_);
  const TaskEntry &entry = tasks_[task];
  const std::uint32_t level = scheduler_->level(task);
  TaskFigures figures{.jobs = scheduler_->accounting(task),
                      .usage = entry.usage,
                      .priority = os() && level != sched::kNoLevel ? placement_.priority_of_level(level) : 0,
                      .active = entry.busy,
                      .away = entry.away,
                      .ready = scheduler_->ready(task),
                      .most_waits = entry.most_waits,
                      .longest_waits = entry.longest_waits,
                      .kept_worker = entry.kept_worker,
                      .late = entry.late,
                      .late_end_to_end = entry.late_end_to_end,
                      .preemptions = entry.preemptions,
                      .response = entry.response,
                      .execution = entry.execution,
                      .end_to_end = entry.end_to_end};
  figures.jobs.skipped -= entry.withdrawn;
  figures.jobs.aborted -= entry.cancelled;
  return figures;
}

void Engine::figures(std::vector<ThreadFigures> &out) const {
  out.clear();
  out.reserve(pool_.size());  // spares allocations under the lock
  const LockGuard guard(lock_);
  for (const auto &thread : pool_.threads()) {
    out.push_back({thread->used, thread->stack.empty() ? TaskId() : thread->stack.back().task});
  }
}

void Engine::figures(std::vector<DeviceFigures> &out) const {
  devices_.reserve(out);
  const LockGuard guard(lock_);
  devices_.figures(now(), out);
}

// For observers that look from time to time.
void Engine::started(std::vector<StartedJob> &out) const {
  out.clear();
  out.reserve(2 * std::size_t{pool_.size()});  // mostly enough, which spares an allocation under the lock
  {
    const LockGuard guard(lock_);
    for (const auto &thread : pool_.threads()) {
      for (const Job &job : thread->stack) out.push_back(StartedJob{.job = job, .thread = thread->index});
      if (thread->stack.empty()) continue;
      StartedJob &topmost = out.back();
      topmost.on_top = true;
      // Null, or another job, while the thread is on its way into the job or out of it.
      const RunningJob *running = thread->top.load(std::memory_order_acquire);
      if (running != nullptr && running->job.slot == topmost.job.slot) topmost.begun = running->begun;
    }
    waiting_.for_each([&](const WaitingJob &job) {
      if (job.thread == nullptr) return;
      out.push_back({.job = job.job, .thread = job.thread->index, .on_top = true, .lends = true, .begun = job.begun});
    });
  }
  for (StartedJob &started : out) {
    if (started.begun == kNever) continue;
    const clockid_t clock = pool_.threads()[started.thread]->cpu_clock;
    started.thread_cpu = cpu_now(clock);
    started.thread_id = thread_of(clock);
  }
}

}  // namespace redag::runtime
