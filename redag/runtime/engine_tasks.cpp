// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The engine's tasks: adds, changes and removes them while jobs run, and reports their counts.
#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/engine_locked.hpp"

namespace redag::runtime {

void Engine::bind(const Workload &workload, std::vector<Body> bodies) {
  REDAG_CHECK(bodies.size() == workload.task_count(), "every task needs a body");
  Locked locked(*this);
  for (const TaskRef &ref : flatten(workload)) register_task(ref.id, *ref.task, ref.dag, bodies[ref.id.value]);
}

AddedDag Engine::add_dag(const Dag &dag, std::vector<Body> bodies) {
  REDAG_CHECK(bodies.size() == dag.tasks.size(), "every task needs a body");
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  AddedDag added;
  added.dag = scheduler_->add_dag(dag, at);
  const std::span<const TaskId> tasks = scheduler_->tasks_of(added.dag);
  added.tasks.assign(tasks.begin(), tasks.end());
  for (std::size_t i = 0; i < bodies.size(); ++i) register_task(added.tasks[i], dag.tasks[i], added.dag, bodies[i]);
  decide(locked, at);
  return added;
}

TaskId Engine::add_task(DagId dag, std::uint32_t rank, const Task &task, Body body,
                        std::shared_ptr<SkipListener> listener) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  const TaskId id = scheduler_->add_task(dag, rank, task, at);
  register_task(id, task, dag, body, std::move(listener));
  decide(locked, at);
  return id;
}

void Engine::remove_dag(DagId dag) {
  std::vector<Body> doomed;  // destroyed without the lock: destructors are the user's code
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  REDAG_CHECK(dag.value < scheduler_->dag_slots(), "removal of a DAG that does not exist");
  for (const TaskId task : scheduler_->tasks_of(dag)) tasks_.remove(task, doomed);
  scheduler_->remove_dag(dag, at);
  decide(locked, at);
}

void Engine::remove_task(TaskId task) {
  std::vector<Body> doomed;
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  tasks_.remove(task, doomed);
  scheduler_->remove_task(task, at);
  decide(locked, at);
}

void Engine::set_timing(TaskId task, Duration period, Duration deadline) {
  const Time at = now();
  Locked locked(*this);
  withdraw_if_halting();
  scheduler_->set_timing(task, period, deadline, at);
  tasks_[task].deadline = deadline;
  decide(locked, at);
}

void Engine::register_task(TaskId id, const Task &task, DagId dag, Body &body, std::shared_ptr<SkipListener> listener) {
  if (listener != nullptr) has_listeners_.store(true, std::memory_order_relaxed);
  tasks_.add(id, task, scheduler_->criticality(dag) == Criticality::High, body, std::move(listener));
  for (const auto &thread : pool_.threads()) thread->stack.reserve(tasks_.most_started());
}

sched::Accounting Engine::accounting(TaskId task) const {
  const LockGuard guard(lock_);
  sched::Accounting accounting = scheduler_->accounting(task);
  accounting.skipped -= tasks_[task].withdrawn;
  return accounting;
}

Usage Engine::usage(TaskId task) const {
  const LockGuard guard(lock_);
  return tasks_[task].usage;
}

TaskFigures Engine::figures(TaskId task) const {
  const LockGuard guard(lock_);
  const TaskEntry &entry = tasks_[task];
  TaskFigures figures{scheduler_->accounting(task),
                      entry.usage,
                      entry.busy,
                      scheduler_->ready(task),
                      entry.late,
                      entry.preemptions,
                      entry.response};
  figures.jobs.skipped -= entry.withdrawn;
  return figures;
}

}  // namespace redag::runtime
