// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/job_table.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace redag::sched {

DagId JobTable::append_dag(const Dag &dag) {
  DagId id(dags.size());
  if (free_dags_.empty()) {
    dags.emplace_back();
  } else {
    id = free_dags_.back();
    free_dags_.pop_back();
  }
  dags[id.value] = DagState{dag.max_active, dag.max_pending, 0, dag.criticality, false, false, {}, dag.degrade};
  const std::vector<std::uint32_t> topological = topological_ranks(dag);
  for (std::size_t i = 0; i < dag.tasks.size(); ++i) add_state(id, topological[i], dag.tasks[i]);
  const std::vector<TaskId> &ids = dags[id.value].tasks;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    TaskState &task = tasks[ids[i].value];
    task.is_special = task.is_special || (task.timer && !dag.tasks[i].predecessors.empty());
    for (const std::uint32_t p : dag.tasks[i].predecessors) task.joined = tasks[ids[p].value].joined = true;
  }
  precedence.add_dag(dag, ids);
  reserve_step();
  return id;
}

TaskId JobTable::append_task(DagId dag, std::uint32_t rank, const Task &task) {
  const TaskId id = add_state(dag, rank, task);
  tasks[id.value].on_grid = false;
  precedence.add_task(task, id);
  reserve_step();
  return id;
}

TaskId JobTable::add_state(DagId dag, std::uint32_t rank, const Task &task) {
  static_assert(offsetof(TaskState, skipped) == 64, "what every job needs of its task is in one cache line");
  REDAG_CHECK(task.period > 0 && task.deadline > 0, "a task needs a period and a deadline (inherit_periods)");
  REDAG_CHECK(task.concurrency > 0, "a task that may have no job in progress never runs");
  TaskId id(tasks.size());
  if (free_tasks_.empty()) {
    tasks.emplace_back();
  } else {
    id = free_tasks_.back();
    free_tasks_.pop_back();
  }
  TaskState state;
  state.period = task.period;
  state.offset = task.offset;
  state.deadline = task.deadline;
  state.dag = dag;
  if (!task.group.empty()) state.group = join_group(task.group);
  state.queue_depth = task.overrun == Overrun::Queue ? std::max(1U, task.queue_depth) : 0;
  state.concurrency = task.concurrency;
  state.topological_rank = rank;
  state.fixed_priority = task.priority.value_or(0);
  state.timer = task.activation == Activation::Timer;
  if (state.timer && keeps_timer_releases) state.queue_depth = kUnboundedQueue;
  state.on_budget = task.on_budget;
  state.is_special = dags[dag.value].max_pending > 0;
  state.degraded = high_mode && dags[dag.value].degrades();
  // One slot for each job that can be started, each that can be ready, and one that waits for predecessors.
  const std::uint32_t queued = state.queue_depth == kUnboundedQueue ? 1 : std::max(1U, state.queue_depth);
  const std::uint32_t slot_count = state.concurrency + queued + 1;
  for (std::uint32_t i = 0; i < slot_count; ++i) {
    const std::uint32_t slot = new_slot();
    jobs[slot].next = state.free_slot;
    state.free_slot = slot;
  }
  tasks[id.value] = state;
  dags[dag.value].tasks.push_back(id);
  return id;
}

// Reserves room for what one instant can bring. That is, for each task: a release, the skip of its last job, readiness,
// deferral, start and preemption. HI mode can skip or demote every job, and a late timer reports many releases at once.
void JobTable::reserve_step() {
  // Any started job can change its level, and any can be woken or begin to be served.
  const std::size_t waits = devices.empty() ? 0 : jobs.size();
  const std::size_t dispatches = 3 * std::size_t{config.workers} + jobs.size() + waits + 16;
  step.reserve(dispatches, 3 * (jobs.size() + kMostReleasesAtOnce) + 2 * waits + 64);
}

void JobTable::collect() {
  if (!std::exchange(has_removed, false)) return;
  std::vector<bool> in_use(tasks.size(), false);
  for (const Job &job : jobs) {
    if (job.state == JobState::Free) continue;
    in_use[job.task.value] = true;
    if (job.state != JobState::Waiting) in_use[job.priority_of.value] = true;
  }
  std::vector<TaskId> gone;
  for (std::uint32_t t = 0; t < tasks.size(); ++t) {
    if (tasks[t].life != TaskLife::Removed) continue;
    has_removed = has_removed || in_use[t];
    if (!in_use[t]) gone.emplace_back(t);
  }
  for (const TaskId task : gone) retire(task);
  if (!config.reuse_ids) return;
  if (!gone.empty()) precedence.forget(gone);
  for (std::uint32_t d = 0; d < dags.size(); ++d) {
    DagState &dag = dags[d];
    if (!dag.removed || dag.free || !dag.tasks.empty()) continue;
    dag.free = true;
    free_dags_.emplace_back(d);
  }
}

void JobTable::retire(TaskId id) {
  TaskState &task = tasks[id.value];
  task.life = TaskLife::Gone;
  if (task.group != kNil) leave_group(task.group);
  task.group = kNil;
  std::erase(dags[task.dag.value].tasks, id);
  if (!config.reuse_ids) return;
  while (task.free_slot != kNil) free_slots_.push_back(take_slot(task));
  free_tasks_.push_back(id);
}

std::uint32_t JobTable::join_group(const std::string &name) {
  const auto [place, is_new] = group_positions_.try_emplace(name, 0U);
  if (is_new) {
    const auto unused = std::find_if(groups_.begin(), groups_.end(), [](const Group &g) { return g.tasks == 0; });
    place->second = static_cast<std::uint32_t>(unused - groups_.begin());
    if (unused == groups_.end()) groups_.emplace_back();
    groups_[place->second] = Group{place, 0};
  }
  ++groups_[place->second].tasks;
  return place->second;
}

void JobTable::leave_group(std::uint32_t position) {
  Group &group = groups_[position];
  if (--group.tasks == 0) group_positions_.erase(group.name);
}

void JobTable::prioritise() {
  std::vector<Duration> dag_periods(dags.size(), kNever);
  for (const TaskState &task : tasks) {
    if (task.life == TaskLife::Gone) continue;
    dag_periods[task.dag.value] = std::min(dag_periods[task.dag.value], task.period);
  }
  std::vector<RankedTask> ranked;
  for (std::uint32_t t = 0; t < tasks.size(); ++t) {
    const TaskState &task = tasks[t];
    if (task.life == TaskLife::Gone) continue;
    ranked.push_back(RankedTask{task.period, task.deadline, task.fixed_priority, dags[task.dag.value].criticality,
                                dag_periods[task.dag.value], task.dag.value, task.topological_rank, TaskId(t)});
  }
  const std::vector<Priority> priorities = assign_priorities(ranked, config.policy, config.ties, config.levels);
  tier_count_ = 0;
  for (const Priority &priority : priorities) tier_count_ = std::max(tier_count_, priority.tier + 1);
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    TaskState &task = tasks[ranked[i].task.value];
    task.rank = priorities[i].rank;
    task.tier = priorities[i].tier;
    task.level = priorities[i].level;
    task.key = task.degraded ? demoted_key(task) : task.tier;
  }
  for (Job &job : jobs) {
    if (job.state == JobState::Free || job.state == JobState::Waiting) continue;
    const bool has_inherited = job.priority_of != job.task;
    job.rank = tasks[job.task.value].rank;
    if (is_static(config.policy)) job.key = has_inherited ? tasks[job.priority_of.value].key : own_key(job);
    // What the job inherited may now be no more urgent than its own key.
    if (has_inherited && own_key(job) <= job.key) {
      job.priority_of = job.task;
      job.key = own_key(job);
    }
  }
}

std::uint32_t JobTable::new_slot() {
  if (free_slots_.empty()) {
    jobs.emplace_back();
    return static_cast<std::uint32_t>(jobs.size() - 1);
  }
  const std::uint32_t slot = free_slots_.back();
  free_slots_.pop_back();
  return slot;
}

// The task has no free slot: only timers without an overrun rule get more.
[[gnu::noinline]] std::uint32_t JobTable::one_more_slot(const TaskState &task) {
  REDAG_CHECK(task.queue_depth == kUnboundedQueue, "a task has more jobs than its overrun rule allows");
  return new_slot();
}

std::int64_t JobTable::own_key(const Job &job) const {
  const TaskState &task = task_of(job);
  if (job.demoted || task.degraded) return demoted_key(task);
  return is_static(config.policy) ? task.tier : job.deadline;
}

}  // namespace redag::sched
