// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/priority_scheduler.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::sched {

PriorityScheduler::PriorityScheduler(const Workload &workload, const Config &config)
    : Lifecycle(config), static_(is_static(config.policy)), workers_(config.workers), free_workers_(config.workers) {
  REDAG_CHECK(config.workers > 0, "a platform has at least one worker");
  REDAG_CHECK(config.levels == 0 || static_, "limited levels need a static policy");
  open_workers_.reserve(config.workers);
  for (std::uint32_t w = 0; w < config.workers; ++w) free_workers_.set(w);
  load(workload);
}

// ---- decisions ----

Step PriorityScheduler::dispatch(Time now, std::uint32_t most) {
  begin(now);
  for (std::uint32_t best = top(); best != kNil; best = top()) {
    const bool starts = !jobs_[best].started();
    if (starts && most == 0) {
      if (!set_aside(best)) break;
      continue;
    }
    Place place;
    if (!find_place(jobs_[best], place)) break;
    if (park_if_not_eligible(best)) continue;
    if (starts) --most;
    run(best, place);
  }
  close_open_workers();
  if (has_post_dispatch_work_) do_post_dispatch_work();
  return step();
}

// No more jobs may start. Holds this job back and lets dispatch() look past it for started jobs, as long as there are
// some in the ready queue. Only full preemption keeps them there.
bool PriorityScheduler::set_aside(std::uint32_t slot) {
  if (queued_started_ == 0) return false;
  remove(slot);
  jobs_[slot].next = held_back_;
  held_back_ = slot;
  has_post_dispatch_work_ = true;
  return true;
}

void PriorityScheduler::do_post_dispatch_work() {
  put_back();
  if (high_mode()) restore_if_idle();
  has_post_dispatch_work_ = high_mode();
}

void PriorityScheduler::put_back() {
  while (held_back_ != kNil) {
    const std::uint32_t slot = held_back_;
    held_back_ = jobs_[slot].next;
    jobs_[slot].next = kNil;
    push(slot);
  }
}

void PriorityScheduler::preemption_point(JobSlot job, Time now) {
  REDAG_CHECK(config_.preemption == Preemption::Cooperative, "preemption points are for cooperative preemption");
  begin(now);
  REDAG_CHECK(jobs_[job.value].state == JobState::Running, "a preemption point of a job that does not run");
  open(jobs_[job.value].worker.value);
}

bool PriorityScheduler::outranked(JobSlot job) const {
  return config_.preemption == Preemption::Cooperative && top() != kNil && outranks(jobs_[top()], jobs_[job.value]);
}

// Finds where `job`, the first in the ready queue, could run now. Returns false if there is no place.
bool PriorityScheduler::find_place(const Job &job, Place &place) const {
  if (!free_workers_.empty()) {
    const bool last_is_free = job.worker.valid() && workers_[job.worker.value].stack == kNil;
    place = Place{last_is_free ? job.worker : WorkerId(free_workers_.first()), kNil};
    return true;
  }
  if (config_.preemption == Preemption::None) return false;
  const std::uint32_t victim = least_urgent_running();
  if (victim == kNil || !outranks(job, jobs_[victim])) return false;
  place = Place{jobs_[victim].worker, victim};
  return true;
}

// Returns the job that would lose its worker first: of all running jobs (Full), or of those on top of an open worker
// (Cooperative).
std::uint32_t PriorityScheduler::least_urgent_running() const {
  std::uint32_t least = kNil;
  const auto consider = [&](std::uint32_t slot) {
    if (least == kNil || before(jobs_[least], jobs_[slot])) least = slot;
  };
  if (config_.preemption == Preemption::Full) {
    for (const Worker &worker : workers_) consider(worker.running);
  } else {
    for (const std::uint32_t w : open_workers_) {
      if (workers_[w].open) consider(workers_[w].stack);
    }
  }
  return least;
}

bool PriorityScheduler::outranks(const Job &a, const Job &b) const {
  if (static_) return level_of(a) < level_of(b);
  if (config_.policy == PolicyKind::Fifo) return false;
  // Neither equals nor demoted jobs preempt each other.
  return config_.ties == Ties::Share ? a.key < b.key : before(a, b) && !is_demoted_key(a.key);
}

std::uint32_t PriorityScheduler::level_of(const Job &job) const {
  if (!static_) return 0;
  const auto key = static_cast<std::uint32_t>(job.key);
  return level_of_key_.empty() ? std::min(key, tier_count()) : level_of_key_[key];
}

void PriorityScheduler::run(std::uint32_t slot, const Place &place) {
  const bool resumes = jobs_[slot].started();
  remove(slot);
  if (!resumes) hold_gates(slot);
  make_way(place);
  jobs_[slot].under = config_.preemption == Preemption::Cooperative ? place.victim : kNil;
  const std::uint32_t level = level_of(jobs_[slot]);
  resumes ? resume(slot, place.worker, place.victim, level) : start(slot, place.worker, place.victim, level);
  Worker &worker = workers_[place.worker.value];
  worker.running = slot;
  worker.stack = slot;
  worker.open = false;
}

void PriorityScheduler::make_way(const Place &place) {
  if (place.victim == kNil) {
    free_workers_.clear(place.worker.value);
    return;
  }
  // Cooperative: a job under one that has ended is already suspended.
  if (jobs_[place.victim].state == JobState::Running) suspend(place.victim);
  if (config_.preemption == Preemption::Full) push(place.victim);
}

// Resumes the suspended job on each open worker that no other job took.
void PriorityScheduler::close_open_workers() {
  for (const std::uint32_t w : open_workers_) {
    Worker &worker = workers_[w];
    if (!worker.open) continue;
    worker.open = false;
    if (jobs_[worker.stack].state != JobState::Suspended) continue;
    worker.running = worker.stack;
    resume(worker.stack, WorkerId(w), kNil, level_of(jobs_[worker.stack]));
  }
  open_workers_.clear();
}

// Parked jobs need no check: each waits for a job that has started.
void PriorityScheduler::restore_if_idle() {
  if (top() != kNil) return;
  for (const Worker &worker : workers_) {
    if (worker.stack != kNil) return;
  }
  restore();
}

// ---- eligibility ----

// A worker is available to the job. Parks the job if one of its gates is full. Tries the gates in the order task, DAG,
// group, threads.
bool PriorityScheduler::park_if_not_eligible(std::uint32_t slot) {
  Job &job = jobs_[slot];
  if (job.started()) return false;
  TaskGates &to_pass = task_gates_[job.task.value];
  const auto is_full = [](const Gate &gate) { return gate.used >= gate.capacity; };
  GateKind kind = GateKind::Task;
  std::uint32_t position = job.task.value;
  if (!is_full(to_pass.own)) {
    std::uint32_t i = 0;
    while (i < to_pass.count && !is_full(shared_gates_[to_pass.shared[i]])) ++i;
    if (i == to_pass.count) return false;
    kind = to_pass.kinds[i];
    position = static_cast<std::uint32_t>(task_gates_.size()) + to_pass.shared[i];
  }

  Gate &gate = gate_at(position);
  remove(slot);
  gate.parked.push(jobs_, slot);
  job.parked_at = position;
  if (kind == GateKind::Dag) defer(slot);
  if (kind == GateKind::Threads) ++thread_waits_;
  if (kind == GateKind::Group) inherit(gate.holder, job);
  // Other jobs may now use the places that this job would have used at its other gates.
  for_gates_of(job, [this](Gate &other) { promote_one(other); });
  return true;
}

// Priority inheritance (Sha, Rajkumar, Lehoczky, IEEE TC 39(9), 1990). One step is enough, because a job that holds a
// group waits for none.
void PriorityScheduler::inherit(std::uint32_t holder_slot, const Job &waiter) {
  Job &holder = jobs_[holder_slot];
  if (config_.policy == PolicyKind::Fifo || waiter.key >= holder.key) return;
  const bool is_queued = holder.state == JobState::Suspended && config_.preemption == Preemption::Full;
  if (is_queued) remove(holder_slot);
  const std::uint32_t old_level = level_of(holder);
  holder.key = waiter.key;
  holder.priority_of = waiter.priority_of;
  if (is_queued) push(holder_slot);
  tell_level(holder_slot, old_level);
}

// Full: the operating system also schedules suspended jobs, by the last level that it was told. Cooperative: a
// suspended job stays under others on its worker until the scheduler resumes it.
void PriorityScheduler::tell_level(std::uint32_t slot, std::uint32_t old_level) {
  const Job &job = jobs_[slot];
  const bool is_scheduled = job.state == JobState::Running || config_.preemption == Preemption::Full;
  if (is_scheduled && level_of(job) != old_level) change_level(slot, level_of(job));
}

void PriorityScheduler::on_lowered(std::uint32_t slot) {
  Job &job = jobs_[slot];
  const bool is_queued = job.state == JobState::Suspended && config_.preemption == Preemption::Full;
  if (is_queued) remove(slot);
  const std::uint32_t old_level = level_of(job);
  job.key = own_key(job);
  job.priority_of = job.task;
  if (is_queued) push(slot);
  tell_level(slot, old_level);
  // Puts jobs that wait for the group back into the ready queue, so that the job can inherit from those that remain.
  // Some of them are parked for a thread: when tried again, they find the gate of their group first.
  if (task_of(job).group == kNil) return;
  const TaskGates &held = task_gates_[job.task.value];
  for (std::uint32_t i = 0; i < held.count; ++i) {
    if (held.kinds[i] != GateKind::Group && held.kinds[i] != GateKind::Threads) continue;
    Gate &gate = shared_gates_[held.shared[i]];
    for (std::uint32_t waiter = gate.parked.top(); waiter != kNil; waiter = gate.parked.top()) {
      gate.parked.remove(jobs_, waiter);
      jobs_[waiter].parked_at = kNil;
      push(waiter);
    }
  }
}

void PriorityScheduler::on_ready(std::uint32_t slot) { push(slot); }

void PriorityScheduler::on_withdrawn(std::uint32_t slot) {
  Job &job = jobs_[slot];
  if (job.parked_at != kNil) {
    gate_at(job.parked_at).parked.remove(jobs_, slot);
    job.parked_at = kNil;
    return;
  }
  remove(slot);
  for_gates_of(job, [this](Gate &gate) { promote_one(gate); });
}

void PriorityScheduler::on_end(std::uint32_t slot) {
  const Job &job = jobs_[slot];
  Worker &worker = workers_[job.worker.value];
  if (job.state == JobState::Suspended) {
    // On threads, the operating system ran the job although the scheduler counted it as preempted.
    REDAG_CHECK(config_.preemption == Preemption::Full, "a job ended that is suspended under another");
    remove(slot);
  } else {
    worker.running = kNil;
    worker.stack = job.under;
    if (worker.stack == kNil) {
      worker.open = false;
      free_workers_.set(job.worker.value);
    } else {
      open(job.worker.value);
    }
  }
  for_gates_of(job, [this](Gate &gate) {
    --gate.used;
    promote_one(gate);
  });
}

void PriorityScheduler::open(std::uint32_t worker) {
  if (workers_[worker].open) return;
  workers_[worker].open = true;
  open_workers_.push_back(worker);
}

// If the gate has room, its most urgent parked job goes back to the ready queue. Called once for each place that
// becomes free, and for each queued job that is gone and could have used one.
void PriorityScheduler::promote_one(Gate &gate) {
  const std::uint32_t slot = gate.parked.top();
  if (slot == kNil || gate.used == gate.capacity) return;
  gate.parked.remove(jobs_, slot);
  jobs_[slot].parked_at = kNil;
  push(slot);
}

// ---- the ready queue ----

// Each level has a list for its started jobs, then one for each of its tiers. SCHED_FIFO continues a preempted thread
// before it runs a new one of the same level, and the scheduler does the same.
std::uint32_t PriorityScheduler::list_of(const Job &job) const {
  const auto key = static_cast<std::uint32_t>(job.key);
  const std::uint32_t level = level_of(job);
  if (!job.started()) return key + level + 1;
  const std::uint32_t first = level_of_key_.empty() ? level : first_of_level_[key];
  return first + level;
}

void PriorityScheduler::push(std::uint32_t slot) {
  if (jobs_[slot].started()) ++queued_started_;
  static_ ? levels_.push(jobs_, slot, list_of(jobs_[slot])) : heap_.push(jobs_, slot);
}

void PriorityScheduler::remove(std::uint32_t slot) {
  if (jobs_[slot].started()) --queued_started_;
  static_ ? levels_.remove(jobs_, slot) : heap_.remove(jobs_, slot);
}

void PriorityScheduler::assign_levels() {
  if (config_.levels == 0) return;
  const std::uint32_t tiers = tier_count();
  level_of_key_.assign(2 * std::size_t{tiers}, config_.levels);  // demoted jobs: below all others
  for (const TaskState &task : tasks_) {
    if (task.life != TaskLife::Gone) level_of_key_[task.tier] = task.level;
  }
  first_of_level_.resize(level_of_key_.size());
  for (std::uint32_t key = 0; key < first_of_level_.size(); ++key) {
    const bool is_first = key == 0 || level_of_key_[key] != level_of_key_[key - 1];
    first_of_level_[key] = is_first ? key : first_of_level_[key - 1];
  }
}

// Rebuilds gates, levels and the ready queue. Parked jobs go back to the ready queue and are parked again when tried.
void PriorityScheduler::on_reconfigured() {
  assign_levels();
  const std::size_t lowest = config_.levels > 0 ? config_.levels : tier_count();
  levels_ = LevelQueue(static_ ? 2 * std::size_t{tier_count()} + lowest + 1 : 0);
  heap_ = HeapQueue();
  queued_started_ = 0;

  static_assert(sizeof(TaskGates) == 32, "two tasks' gates in a cache line");
  shared_gates_.clear();
  task_gates_.assign(tasks_.size(), TaskGates{});
  std::vector<std::uint32_t> dag_gates(dag_states_.size(), kNil);
  std::vector<std::uint32_t> group_gates(group_count(), kNil);
  std::uint32_t threads_gate = kNil;
  const auto share = [&](TaskGates &list, GateKind kind, std::uint32_t &gate, std::uint32_t capacity) {
    if (gate == kNil) {
      gate = static_cast<std::uint32_t>(shared_gates_.size());
      shared_gates_.push_back(Gate{capacity, 0, kNil, {}});
    }
    list.kinds[list.count] = kind;
    list.shared[list.count++] = gate;
  };
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const TaskState &task = tasks_[t];
    if (task.life == TaskLife::Gone) continue;
    TaskGates &list = task_gates_[t];
    list.own.capacity = task.concurrency;
    const std::uint32_t max_active = dag_states_[task.dag.value].max_active;
    if (max_active > 0) share(list, GateKind::Dag, dag_gates[task.dag.value], max_active);
    if (task.group != kNil) share(list, GateKind::Group, group_gates[task.group], 1);
    if (config_.max_started > 0) share(list, GateKind::Threads, threads_gate, config_.max_started);
  }

  for (std::uint32_t slot = 0; slot < jobs_.size(); ++slot) {
    Job &job = jobs_[slot];
    job.parked_at = kNil;
    if (job.state == JobState::Ready) push(slot);
    if (!job.started()) continue;
    tell_level(slot, kNil);
    if (job.state == JobState::Suspended && config_.preemption == Preemption::Full) push(slot);
    hold_gates(slot);
  }
}

}  // namespace redag::sched
