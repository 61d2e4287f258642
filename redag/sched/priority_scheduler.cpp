// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/priority_scheduler.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/sched/lifecycle_rules.hpp"

namespace redag::sched {

// Members that are declared inline here are inlined into the rules; nothing else calls them.
template class Lifecycle<PriorityDispatcher>;

PriorityDispatcher::PriorityDispatcher(JobTable &table)
    : table_(table),
      static_(is_static(table.config.policy)),
      workers_(table.config.workers),
      free_workers_(table.config.workers),
      devices_(table) {
  REDAG_CHECK(table.config.workers > 0, "a platform has at least one worker");
  REDAG_CHECK(table.config.levels == 0 || static_, "limited levels need a static policy");
  open_workers_.reserve(table.config.workers);
}

// ---- decisions ----

void PriorityDispatcher::place_ready_jobs(std::uint32_t most) {
  while (may_place()) {
    const std::uint32_t best = top();
    if (best == kNil) return;
    Job &job = table_.jobs[best];
    if (job.started()) {
      if (!resume(best, job)) return;
      continue;
    }
    if (most == 0) {
      if (!set_aside(best)) return;
      continue;
    }
    const Place place = find_place(job);
    if (!place.worker.valid()) return;
    TaskGates &gates = task_gates_[job.task.value];
    if (park_if_not_eligible(best, job, gates)) continue;
    --most;
    start(best, job, gates, place);
  }
}

// Does what the decision left: resumes jobs on open workers, puts back held-back jobs, and lets devices serve.
void PriorityDispatcher::settle() {
  unsettled_ = false;
  if (!open_workers_.empty()) close_open_workers();
  if (held_back_ != kNil) put_back();
  devices_.serve();
}

// The new job holds the gates that both tasks share in the place of the ended one, for which no job waits. A free
// worker that comes before the ended job's own would be the first choice.
[[gnu::always_inline]] inline bool PriorityDispatcher::can_replace(const Job &job, TaskId next) const {
  if (job.state != JobState::Running || job.under != kNil || !open_workers_.empty()) return false;
  if (!free_workers_.empty() && (free_workers_.first() < job.worker.value || top() != kNil)) return false;
  const TaskGates &from = task_gates_[job.task.value];
  const TaskGates &to = task_gates_[next.value];
  if (from.own.parked.top() != kNil || is_full(to.own)) return false;
  for (std::uint32_t i = 0; i < from.count; ++i) {
    if (shared_gates_[from.shared[i]].parked.top() != kNil) return false;
  }
  return true;
}

[[gnu::always_inline]] inline void PriorityDispatcher::replace(std::uint32_t ended, std::uint32_t slot,
                                                               std::uint32_t most) {
  Job &job = table_.jobs[slot];
  const std::uint32_t top_slot = top();
  if (top_slot != kNil) {
    job.child = static_ ? list_of(job) : kNil;
    if (!is_ahead(job, table_.jobs[top_slot])) {
      table_.count_ready(table_.task_of(job), slot);
      on_end(ended);
      push(slot);
      return decide(most);
    }
  }
  const WorkerId worker = table_.jobs[ended].worker;
  --task_gates_[table_.jobs[ended].task.value].own.used;
  TaskGates &gates = task_gates_[job.task.value];
  ++gates.own.used;
  for (std::uint32_t i = 0; i < gates.count; ++i) shared_gates_[gates.shared[i]].holder = slot;
  table_.start_uncounted(slot, worker, kNil, level_of(job));
  workers_[worker.value].running = slot;
  workers_[worker.value].stack = slot;
  if (least_urgent_ != kNil) note_replaced(ended, slot);
  if (top_slot != kNil) decide(most - 1);
}

// No more jobs may start. Holds this job back and lets dispatch() look past it for started jobs, as long as there are
// some in the ready queue.
[[gnu::noinline]] bool PriorityDispatcher::set_aside(std::uint32_t slot) {
  if (queued_started_ == 0) return false;
  remove(slot);
  table_.jobs[slot].next = held_back_;
  held_back_ = slot;
  unsettled_ = true;
  return true;
}

[[gnu::noinline]] void PriorityDispatcher::put_back() {
  while (held_back_ != kNil) {
    const std::uint32_t slot = held_back_;
    held_back_ = table_.jobs[slot].next;
    table_.jobs[slot].next = kNil;
    push(slot);
  }
}

// Finds where `job`, the first in the ready queue, could run now.
inline PriorityDispatcher::Place PriorityDispatcher::find_place(const Job &job) {
  if (!free_workers_.empty()) return Place{WorkerId(free_workers_.first()), kNil};
  if (table_.config.preemption == Preemption::None) return Place{};
  const std::uint32_t victim = least_urgent_running();
  if (victim == kNil || !outranks(job, table_.jobs[victim])) return Place{};
  return Place{table_.jobs[victim].worker, victim};
}

// Returns the job that would lose its worker first: of all running jobs (Full), or of those on top of an open worker
// (Cooperative).
std::uint32_t PriorityDispatcher::least_urgent_running() {
  if (least_urgent_ != kNil) return least_urgent_;
  std::uint32_t least = kNil;
  const auto consider = [&](std::uint32_t slot) {
    if (least == kNil || before(table_.jobs[least], table_.jobs[slot])) least = slot;
  };
  if (table_.config.preemption == Preemption::Full) {
    for (const Worker &worker : workers_) consider(worker.running);
    least_urgent_ = least;
  } else {
    for (const std::uint32_t w : open_workers_) {
      if (workers_[w].open) consider(workers_[w].stack);
    }
  }
  return least;
}

inline bool PriorityDispatcher::outranks(const Job &a, const Job &b) const {
  if (static_) return level_of(a) < level_of(b);
  if (table_.config.policy == PolicyKind::Fifo) return false;
  // Neither equals nor demoted jobs preempt each other.
  return table_.config.ties == Ties::Share ? a.key < b.key : before(a, b) && !table_.is_demoted_key(a.key);
}

[[gnu::always_inline]] inline std::uint32_t PriorityDispatcher::level_of(const Job &job) const {
  if (!static_) return 0;
  return level_of_key_[static_cast<std::uint32_t>(job.key)];
}

[[gnu::always_inline]] inline void PriorityDispatcher::start(std::uint32_t slot, Job &job, TaskGates &gates,
                                                             Place place) {
  remove_unstarted(slot);
  hold_gates(slot, gates);
  ++started_;
  make_way(place);
  if (table_.config.preemption == Preemption::Cooperative) job.under = place.victim;
  table_.start(slot, place.worker, place.victim, level_of(job));
  occupy(place.worker, slot);
}

// Returns false, and changes nothing, if there is no place for the job. Prefers the worker on which it ran last.
[[gnu::noinline]] bool PriorityDispatcher::resume(std::uint32_t slot, Job &job) {
  Place place = find_place(job);
  if (!place.worker.valid()) return false;
  if (place.victim == kNil && workers_[job.worker.value].stack == kNil) place.worker = job.worker;
  remove(slot);
  make_way(place);
  job.under = table_.config.preemption == Preemption::Cooperative ? place.victim : kNil;
  table_.resume(slot, place.worker, place.victim, level_of(job));
  occupy(place.worker, slot);
  return true;
}

[[gnu::always_inline]] inline void PriorityDispatcher::occupy(WorkerId worker, std::uint32_t slot) {
  workers_[worker.value] = Worker{.running = slot, .stack = slot};
  note_running(slot);
}

[[gnu::always_inline]] inline void PriorityDispatcher::note_running(std::uint32_t slot) {
  if (least_urgent_ != kNil && before(table_.jobs[least_urgent_], table_.jobs[slot])) least_urgent_ = slot;
}

[[gnu::noinline]] void PriorityDispatcher::note_replaced(std::uint32_t ended, std::uint32_t slot) {
  if (ended == least_urgent_) forget_least_urgent();
  note_running(slot);
}

inline void PriorityDispatcher::make_way(Place place) {
  if (place.victim == kNil) {
    free_workers_.remove(place.worker.value);
    return;
  }
  // Cooperative: a job under one that has ended is already suspended.
  if (table_.jobs[place.victim].state == JobState::Running) table_.suspend(place.victim);
  forget_least_urgent();
  if (table_.config.preemption == Preemption::Full) push(place.victim);
}

// Resumes the suspended job on each open worker that no other job took.
[[gnu::noinline]] void PriorityDispatcher::close_open_workers() {
  for (const std::uint32_t w : open_workers_) {
    Worker &worker = workers_[w];
    if (!worker.open) continue;
    worker.open = false;
    if (table_.jobs[worker.stack].state != JobState::Suspended) continue;
    worker.running = worker.stack;
    table_.resume(worker.stack, WorkerId(w), kNil, level_of(table_.jobs[worker.stack]));
  }
  open_workers_.clear();
}

// Parked jobs need no check: each waits for a job that has started.
bool PriorityDispatcher::is_idle() const { return top() == kNil && started_ == 0; }

// ---- eligibility ----

// A worker is available to the job. Parks the job if one of its gates is full. Tries the gates in the order task, DAG,
// group, threads.
inline bool PriorityDispatcher::park_if_not_eligible(std::uint32_t slot, const Job &job, const TaskGates &to_pass) {
  if (is_full(to_pass.own)) {
    park(slot, GateKind::Task, job.task.value);
    return true;
  }
  for (std::uint32_t i = 0; i < to_pass.count; ++i) {
    if (!is_full(shared_gates_[to_pass.shared[i]])) continue;
    park(slot, to_pass.kinds[i], static_cast<std::uint32_t>(task_gates_.size()) + to_pass.shared[i]);
    return true;
  }
  return false;
}

[[gnu::noinline]] void PriorityDispatcher::park(std::uint32_t slot, GateKind kind, std::uint32_t position) {
  Job &job = table_.jobs[slot];
  Gate &gate = gate_at(position);
  remove(slot);
  gate.parked.push(table_.jobs, slot);
  job.parked_at = position;
  if (kind == GateKind::Dag) table_.defer(slot);
  if (kind == GateKind::Threads) ++table_.thread_waits;
  if (kind == GateKind::Group) inherit(gate.holder, job);
  // Other jobs may now use the places that this job would have used at its other gates.
  for_gates_of(job, [this](Gate &other) { promote_one(other); });
}

// Priority inheritance (Sha, Rajkumar, Lehoczky, IEEE TC 39(9), 1990). One step is enough, because a job that holds a
// group waits for none.
void PriorityDispatcher::inherit(std::uint32_t holder_slot, const Job &waiter) {
  Job &holder = table_.jobs[holder_slot];
  if (table_.config.policy == PolicyKind::Fifo || waiter.key >= holder.key) return;
  rekey(holder_slot, [&] {
    holder.key = waiter.key;
    holder.priority_of = waiter.priority_of;
  });
}

template <class Change>
void PriorityDispatcher::rekey(std::uint32_t slot, Change change) {
  const Job &job = table_.jobs[slot];
  const bool is_queued = is_in_ready_queue(job);
  if (is_queued) remove(slot);
  devices_.begin_rekey(slot);
  const std::uint32_t old_level = level_of(job);
  forget_least_urgent();
  change();
  devices_.end_rekey(slot);
  if (is_queued) push(slot);
  tell_level(slot, old_level);
}

bool PriorityDispatcher::is_in_ready_queue(const Job &job) const {
  return job.state == JobState::Woken ||
         (job.state == JobState::Suspended && table_.config.preemption == Preemption::Full);
}

// Full: the operating system also schedules suspended jobs, by the last level that it was told. Cooperative: a
// suspended job stays under others on its worker until the scheduler resumes it.
void PriorityDispatcher::tell_level(std::uint32_t slot, std::uint32_t old_level) {
  const Job &job = table_.jobs[slot];
  const bool is_scheduled = job.state == JobState::Running || table_.config.preemption == Preemption::Full;
  if (is_scheduled && level_of(job) != old_level) table_.change_level(slot, level_of(job));
}

void PriorityDispatcher::on_lowered(std::uint32_t slot) {
  Job &job = table_.jobs[slot];
  rekey(slot, [&] {
    job.key = table_.own_key(job);
    job.priority_of = job.task;
  });
  // Puts jobs that wait for the group back into the ready queue, so that the job can inherit from those that remain.
  // Some of them are parked for a thread: when tried again, they find the gate of their group first.
  if (table_.task_of(job).group == kNil) return;
  const TaskGates &held = task_gates_[job.task.value];
  for (std::uint32_t i = 0; i < held.count; ++i) {
    if (held.kinds[i] != GateKind::Group && held.kinds[i] != GateKind::Threads) continue;
    Gate &gate = shared_gates_[held.shared[i]];
    for (std::uint32_t waiter = gate.parked.top(); waiter != kNil; waiter = gate.parked.top()) {
      gate.parked.remove(table_.jobs, waiter);
      table_.jobs[waiter].parked_at = kNil;
      push(waiter);
    }
  }
}

void PriorityDispatcher::on_withdrawn(std::uint32_t slot) {
  Job &job = table_.jobs[slot];
  if (job.parked_at != kNil) {
    gate_at(job.parked_at).parked.remove(table_.jobs, slot);
    job.parked_at = kNil;
    return;
  }
  remove(slot);
  for_gates_of(job, [this](Gate &gate) { promote_one(gate); });
}

inline void PriorityDispatcher::on_end(std::uint32_t slot) {
  const Job &job = table_.jobs[slot];
  --started_;
  if (slot == least_urgent_) forget_least_urgent();
  if (job.state == JobState::Running) {
    leave_worker(job);
  } else {
    leave_queue(slot);
  }
  for_gates_of(job, [this](Gate &gate) {
    --gate.used;
    promote_one(gate);
  });
}

inline void PriorityDispatcher::leave_worker(const Job &job) {
  Worker &worker = workers_[job.worker.value];
  worker.running = kNil;
  worker.stack = job.under;
  if (worker.stack == kNil) {
    worker.open = false;
    free_workers_.add(job.worker.value);
  } else {
    open(job.worker.value);
  }
}

// The started job has no worker. On threads, the operating system can run a job that counts as preempted.
[[gnu::noinline]] void PriorityDispatcher::leave_queue(std::uint32_t slot) {
  const Job &job = table_.jobs[slot];
  if (is_in_ready_queue(job)) return remove(slot);
  REDAG_CHECK(job.state != JobState::Suspended, "a job ended that is suspended under another");
  leave_device(slot);
}

// The job keeps its gates.
void PriorityDispatcher::on_wait(std::uint32_t slot, DeviceId device) {
  const Job &job = table_.jobs[slot];
  const bool may_run_unseen = table_.config.preemption == Preemption::Full && is_in_ready_queue(job);
  REDAG_CHECK(job.state == JobState::Running || may_run_unseen, "a job waits that does not run");
  if (slot == least_urgent_) forget_least_urgent();
  if (job.state == JobState::Running) {
    leave_worker(job);
  } else {
    remove(slot);
  }
  table_.wait(slot, device);
  if (!device.valid()) return;
  devices_.join(slot);
  unsettled_ = true;
}

void PriorityDispatcher::leave_device(std::uint32_t slot) {
  const Job &job = table_.jobs[slot];
  if (job.parked_at == kNil) return;  // it waits without a device
  if (job.state == JobState::Away) unsettled_ = true;
  devices_.leave(slot);
}

void PriorityDispatcher::on_wake(std::uint32_t slot) {
  leave_device(slot);
  table_.wake(slot);
  push(slot);
}

void PriorityDispatcher::open(std::uint32_t worker) {
  if (workers_[worker].open) return;
  workers_[worker].open = true;
  open_workers_.push_back(worker);
  unsettled_ = true;
}

// If the gate has room, its most urgent parked job goes back to the ready queue. Called once for each place that
// becomes free, and for each queued job that is gone and could have used one.
inline void PriorityDispatcher::promote_one(Gate &gate) {
  if (gate.parked.top() == kNil || gate.used == gate.capacity) return;
  promote(gate);
}

[[gnu::noinline]] void PriorityDispatcher::promote(Gate &gate) {
  const std::uint32_t slot = gate.parked.top();
  gate.parked.remove(table_.jobs, slot);
  table_.jobs[slot].parked_at = kNil;
  push(slot);
}

// ---- the ready queue ----

// Each level has a list for its started jobs, then one for each of its tiers. SCHED_FIFO continues a preempted thread
// before it runs a new one of the same level, and the scheduler does the same. In other modes, a woken job goes by the
// order of jobs alone.
inline std::uint32_t PriorityDispatcher::list_of(const Job &job) const {
  const auto key = static_cast<std::uint32_t>(job.key);
  const std::uint32_t level = level_of(job);
  if (!job.started() || table_.config.preemption != Preemption::Full) return key + level + 1;
  return first_of_level_[key] + level;
}

inline void PriorityDispatcher::push(std::uint32_t slot) {
  Job &job = table_.jobs[slot];
  if (job.started()) ++queued_started_;
  job.child = static_ ? list_of(job) : kNil;
  const std::uint32_t top_slot = top();
  if (top_slot != kNil && !is_ahead(job, table_.jobs[top_slot])) return enqueue(slot);
  if (first_ != kNil) enqueue(first_);
  first_ = slot;
}

[[gnu::noinline]] void PriorityDispatcher::enqueue(std::uint32_t slot) {
  static_ ? levels_.push(table_.jobs, slot, table_.jobs[slot].child) : heap_.push(table_.jobs, slot);
}

// Returns true if `a` goes before `b` in the ready queue. Under static policies, Job::child is the number of the list.
inline bool PriorityDispatcher::is_ahead(const Job &a, const Job &b) const {
  return static_ && a.child != b.child ? a.child < b.child : before(a, b);
}

[[gnu::noinline]] void PriorityDispatcher::remove(std::uint32_t slot) {
  if (table_.jobs[slot].started()) --queued_started_;
  remove_unstarted(slot);
}

inline void PriorityDispatcher::remove_unstarted(std::uint32_t slot) {
  if (slot == first_) {
    first_ = kNil;
  } else {
    dequeue(slot);
  }
}

[[gnu::noinline]] void PriorityDispatcher::dequeue(std::uint32_t slot) {
  static_ ? levels_.remove(table_.jobs, slot) : heap_.remove(table_.jobs, slot);
}

// Returns the lowest level.
std::uint32_t PriorityDispatcher::assign_levels() {
  const std::uint32_t tiers = table_.tier_count();
  const std::uint32_t lowest = table_.config.levels > 0 ? table_.config.levels : tiers;
  level_of_key_.assign(2 * std::size_t{tiers}, lowest);  // demoted jobs: below all others
  for (const TaskState &task : table_.tasks) {
    if (task.life != TaskLife::Gone) level_of_key_[task.tier] = task.level;
  }
  first_of_level_.resize(level_of_key_.size());
  for (std::uint32_t key = 0; key < first_of_level_.size(); ++key) {
    const bool is_first = key == 0 || level_of_key_[key] != level_of_key_[key - 1];
    first_of_level_[key] = is_first ? key : first_of_level_[key - 1];
  }
  return lowest;
}

// Rebuilds gates, levels and the ready queue. Parked jobs go back to the ready queue and are parked again when tried.
void PriorityDispatcher::on_reconfigured() {
  if (static_) {
    const std::size_t lowest = assign_levels();
    levels_ = LevelQueue(level_of_key_.size() + lowest + 1);
  }
  heap_ = HeapQueue();
  first_ = kNil;
  queued_started_ = 0;
  forget_least_urgent();

  static_assert(sizeof(TaskGates) == 32, "two tasks' gates in a cache line");
  shared_gates_.clear();
  task_gates_.assign(table_.tasks.size(), TaskGates{});
  std::vector<std::uint32_t> dag_gates(table_.dags.size(), kNil);
  std::vector<std::uint32_t> group_gates(table_.group_slots(), kNil);
  std::uint32_t threads_gate = kNil;
  const auto share = [&](TaskGates &list, GateKind kind, std::uint32_t &gate, std::uint32_t capacity) {
    if (gate == kNil) {
      gate = static_cast<std::uint32_t>(shared_gates_.size());
      shared_gates_.push_back(Gate{capacity, 0, kNil, {}});
    }
    list.kinds[list.count] = kind;
    list.shared[list.count++] = gate;
  };
  for (std::size_t t = 0; t < table_.tasks.size(); ++t) {
    const TaskState &task = table_.tasks[t];
    if (task.life == TaskLife::Gone) continue;
    TaskGates &list = task_gates_[t];
    list.own.capacity = task.concurrency;
    const std::uint32_t max_active = table_.dags[task.dag.value].max_active;
    if (max_active > 0) share(list, GateKind::Dag, dag_gates[task.dag.value], max_active);
    if (task.group != kNil) share(list, GateKind::Group, group_gates[task.group], 1);
    if (table_.config.max_started > 0) share(list, GateKind::Threads, threads_gate, table_.config.max_started);
  }

  for (std::uint32_t slot = 0; slot < table_.jobs.size(); ++slot) {
    Job &job = table_.jobs[slot];
    if (!job.started()) job.parked_at = kNil;
    if (job.state == JobState::Ready) push(slot);
    if (!job.started()) continue;
    tell_level(slot, kNil);
    if (is_in_ready_queue(job)) push(slot);
    hold_gates(slot, task_gates_[job.task.value]);
  }
  devices_.rebuild();
}

}  // namespace redag::sched
