// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/lifecycle.hpp"

#include <algorithm>
#include <cstddef>

#include "redag/base/check.hpp"

namespace redag::sched {
namespace {

Reason reason_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::Threw: return Reason::Exception;
    case Outcome::BudgetExceeded: return Reason::Budget;
    case Outcome::NoData: return Reason::NoData;
    case Outcome::Finished: break;
  }
  return Reason::None;
}

}  // namespace

void Lifecycle::release(TaskId task, Time nominal, Time now) {
  REDAG_CHECK(task.value < tasks_.size(), "release of a task that does not exist");
  REDAG_CHECK(tasks_[task.value].timer, "data tasks are released by their predecessors");
  begin(now);
  if (tasks_[task.value].life != TaskLife::Live) return;
  restricted_ ? admit_or_refuse(task, nominal, nominal) : admit(task, nominal, nominal);
}

void Lifecycle::admit_or_refuse(TaskId id, Time nominal, Time origin) {
  if (closed_) return;
  const Reason reason = refusal(tasks_[id.value], nominal);
  reason == Reason::None ? admit(id, nominal, origin) : refuse(id, nominal, reason);
}

void Lifecycle::miss(TaskId id, Time nominal, Time now, Reason reason) {
  REDAG_CHECK(id.value < tasks_.size(), "release of a task that does not exist");
  TaskState &task = tasks_[id.value];
  REDAG_CHECK(task.timer, "data tasks are released by their predecessors");
  begin(now);
  if (!takes_releases(task)) return;
  const Reason refused = restricted_ ? refusal(task, nominal) : Reason::None;
  refuse(id, nominal, refused == Reason::None ? reason : refused);
}

// Counts a release and returns the number of its job.
std::uint32_t Lifecycle::count_release(TaskState &task) {
  const std::uint32_t number = task.next_number++;
  if (task.next_number == 0) task.released_earlier += std::uint64_t{1} << 32U;
  return number;
}

void Lifecycle::refuse(TaskId id, Time nominal, Reason reason) {
  TaskState &task = tasks_[id.value];
  Job fresh;
  fresh.task = id;
  fresh.number = count_release(task);
  emit(fresh, JobEventKind::Released, nominal);
  ++task.skipped;
  emit(fresh, JobEventKind::Skipped, 0, reason);
}

void Lifecycle::complete(JobSlot job_slot, Time now, Outcome outcome) {
  REDAG_CHECK(job_slot.value < jobs_.size() && jobs_[job_slot.value].started(),
              "completion of a job that does not run");
  begin(now);
  const std::uint32_t slot = job_slot.value;
  const Job job = jobs_[slot];
  TaskState &task = tasks_[job.task.value];
  if (outcome == Outcome::Finished) {
    ++task.finished;
    emit(job, JobEventKind::Finished, now);
  } else {
    ++task.aborted;
    emit(job, JobEventKind::Aborted, now, reason_of(outcome));
  }
  // The job used its budget and ended at one instant: drop its pending level change.
  std::erase_if(dispatches_, [&](const Dispatch &change) { return change.job == job_slot; });
  on_end(slot);
  free_slot(slot);
  if (outcome != Outcome::Finished || !task.joined || !takes_releases(task)) return;

  precedence_.on_complete(job.task, job.release, job.origin, now, [&](TaskId successor) {
    const TaskState &next = tasks_[successor.value];
    if (next.life != TaskLife::Live) return;
    if (!next.timer) {
      const Precedence::Data data = precedence_.consume(successor);
      restricted_ ? admit_or_refuse(successor, data.complete, data.origin)
                  : admit(successor, data.complete, data.origin);
    } else if (next.waiting != kNil) {
      make_ready(next.waiting, precedence_.consume(successor).origin);
    }
  });
}

// ---- reconfiguration ----

void Lifecycle::load(const Workload &workload) {
  for (const Dag &dag : workload.dags) append_dag(dag);
  prioritise();
  on_reconfigured();
}

DagId Lifecycle::add_dag(const Dag &dag, Time now) {
  begin(now);
  collect();
  const DagId id = append_dag(dag);
  prioritise();
  on_reconfigured();
  return id;
}

TaskId Lifecycle::add_task(DagId dag, std::uint32_t rank, const Task &task, Time now) {
  REDAG_CHECK(dag.value < dag_states_.size() && !dag_states_[dag.value].removed,
              "a task for a DAG that does not exist");
  REDAG_CHECK(task.activation == Activation::Timer && task.predecessors.empty(),
              "a task that is added alone has no predecessors");
  begin(now);
  collect();
  const TaskId id = append_task(dag, rank, task);
  precedence_.add_task(task, id);
  reserve_step();
  prioritise();
  on_reconfigured();
  return id;
}

void Lifecycle::remove_dag(DagId dag, Time now) {
  REDAG_CHECK(dag.value < dag_states_.size(), "removal of a DAG that does not exist");
  begin(now);
  dag_states_[dag.value].removed = true;
  for (const TaskId task : dag_states_[dag.value].tasks) {
    tasks_[task.value].life = TaskLife::Removed;
    forget_skip(tasks_[task.value]);
  }
  skip_all(Reason::Removed, [&](const Job &job) { return tasks_[job.task.value].dag == dag; });
}

void Lifecycle::remove_task(TaskId task, Time now) {
  REDAG_CHECK(task.value < tasks_.size(), "removal of a task that does not exist");
  begin(now);
  if (tasks_[task.value].life != TaskLife::Live) return;
  tasks_[task.value].life = TaskLife::Removed;
  forget_skip(tasks_[task.value]);
  skip_all(Reason::Removed, [&](const Job &job) { return job.task == task; });
}

void Lifecycle::set_timing(TaskId task, Duration period, Duration deadline, Time now) {
  REDAG_CHECK(task.value < tasks_.size(), "a new period for a task that does not exist");
  REDAG_CHECK(period > 0 && deadline > 0, "a task needs a period and a deadline");
  begin(now);
  if (tasks_[task.value].life == TaskLife::Gone) return;
  tasks_[task.value].period = period;
  tasks_[task.value].deadline = deadline;
  precedence_.set_period(task, period);
  prioritise();
  on_reconfigured();
}

void Lifecycle::close(Time now) {
  begin(now);
  closed_ = true;
  refresh_restricted();
  skip_all(Reason::Removed, [](const Job &) { return true; });
}

DagId Lifecycle::append_dag(const Dag &dag) {
  DagId id(dag_states_.size());
  if (free_dags_.empty()) {
    dag_states_.emplace_back();
  } else {
    id = free_dags_.back();
    free_dags_.pop_back();
  }
  dag_states_[id.value] = DagState{dag.max_active, dag.max_pending, 0, dag.criticality, false, false, {}, dag.degrade};
  const std::vector<std::uint32_t> topological = topological_ranks(dag);
  for (std::size_t i = 0; i < dag.tasks.size(); ++i) append_task(id, topological[i], dag.tasks[i]);
  const std::vector<TaskId> &ids = dag_states_[id.value].tasks;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    for (const std::uint32_t p : dag.tasks[i].predecessors)
      tasks_[ids[i].value].joined = tasks_[ids[p].value].joined = true;
  }
  precedence_.add_dag(dag, ids);
  reserve_step();
  return id;
}

TaskId Lifecycle::append_task(DagId dag, std::uint32_t rank, const Task &task) {
  static_assert(offsetof(TaskState, released_earlier) == 64, "what every job needs of its task is in one cache line");
  REDAG_CHECK(task.period > 0 && task.deadline > 0, "a task needs a period and a deadline (inherit_periods)");
  REDAG_CHECK(task.concurrency > 0, "a task that may have no job in progress never runs");
  TaskId id(tasks_.size());
  if (free_tasks_.empty()) {
    tasks_.emplace_back();
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
  if (state.timer && kept_ == TimerReleases::AllKept) state.queue_depth = kUnboundedQueue;
  state.on_budget = task.on_budget;
  state.degraded = high_mode_ && degrades(dag_states_[dag.value]);
  // One slot for each job that can be started, each that can be ready, and one that waits for predecessors.
  const std::uint32_t queued = state.queue_depth == kUnboundedQueue ? 1 : std::max(1U, state.queue_depth);
  const std::uint32_t slot_count = state.concurrency + queued + 1;
  for (std::uint32_t i = 0; i < slot_count; ++i) {
    const std::uint32_t slot = new_slot();
    jobs_[slot].next = state.free_slot;
    state.free_slot = slot;
  }
  tasks_[id.value] = state;
  dag_states_[dag.value].tasks.push_back(id);
  return id;
}

// Reserves room for what one instant can bring. That is, for each task: a release, the skip of its last job, readiness,
// deferral, start and preemption. HI mode can skip or demote every job, and a late timer reports many releases at once.
void Lifecycle::reserve_step() {
  events_.reserve(3 * (jobs_.size() + kMostReleasesAtOnce) + 64);
  // Any started job can change its level.
  dispatches_.reserve(3 * std::size_t{config_.workers} + jobs_.size() + 16);
}

// Removes tasks without any job left from the order of priority. With reuse_ids, also frees their slots.
void Lifecycle::collect() {
  std::vector<bool> in_use(tasks_.size(), false);
  for (const Job &job : jobs_) {
    if (job.state == JobState::Free) continue;
    in_use[job.task.value] = true;
    if (job.state != JobState::Waiting) in_use[job.priority_of.value] = true;
  }
  std::vector<TaskId> gone;
  for (std::uint32_t t = 0; t < tasks_.size(); ++t) {
    if (tasks_[t].life == TaskLife::Removed && !in_use[t]) gone.emplace_back(t);
  }
  for (const TaskId task : gone) retire(task);
  if (!config_.reuse_ids) return;
  if (!gone.empty()) precedence_.forget(gone);
  for (std::uint32_t d = 0; d < dag_states_.size(); ++d) {
    DagState &dag = dag_states_[d];
    if (!dag.removed || dag.free || !dag.tasks.empty()) continue;
    dag.free = true;
    free_dags_.emplace_back(d);
  }
}

void Lifecycle::retire(TaskId id) {
  TaskState &task = tasks_[id.value];
  task.life = TaskLife::Gone;
  if (task.group != kNil) leave_group(task.group);
  task.group = kNil;
  std::erase(dag_states_[task.dag.value].tasks, id);
  if (!config_.reuse_ids) return;
  while (task.free_slot != kNil) free_slots_.push_back(take_slot(task));
  free_tasks_.push_back(id);
}

std::uint32_t Lifecycle::join_group(const std::string &name) {
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

void Lifecycle::leave_group(std::uint32_t position) {
  Group &group = groups_[position];
  if (--group.tasks == 0) group_positions_.erase(group.name);
}

void Lifecycle::prioritise() {
  std::vector<Duration> dag_periods(dag_states_.size(), kNever);
  for (const TaskState &task : tasks_) {
    if (task.life == TaskLife::Gone) continue;
    dag_periods[task.dag.value] = std::min(dag_periods[task.dag.value], task.period);
  }
  std::vector<RankedTask> ranked;
  for (std::uint32_t t = 0; t < tasks_.size(); ++t) {
    const TaskState &task = tasks_[t];
    if (task.life == TaskLife::Gone) continue;
    ranked.push_back(RankedTask{task.period, task.deadline, task.fixed_priority,
                                dag_states_[task.dag.value].criticality, dag_periods[task.dag.value], task.dag.value,
                                task.topological_rank, TaskId(t)});
  }
  const std::vector<Priority> priorities = assign_priorities(ranked, config_.policy, config_.ties, config_.levels);
  tier_count_ = 0;
  for (const Priority &priority : priorities) tier_count_ = std::max(tier_count_, priority.tier + 1);
  for (std::size_t i = 0; i < ranked.size(); ++i) {
    TaskState &task = tasks_[ranked[i].task.value];
    task.rank = priorities[i].rank;
    task.tier = priorities[i].tier;
    task.level = priorities[i].level;
    task.key = task.degraded ? demoted_key(task) : task.tier;
  }
  for (Job &job : jobs_) {
    if (job.state == JobState::Free || job.state == JobState::Waiting) continue;
    const bool has_inherited = job.priority_of != job.task;
    job.rank = tasks_[job.task.value].rank;
    if (is_static(config_.policy)) {
      job.key = has_inherited ? tasks_[job.priority_of.value].key : own_key(job);
    }
    // What the job inherited may now be no more urgent than its own key.
    if (has_inherited && own_key(job) <= job.key) {
      job.priority_of = job.task;
      job.key = own_key(job);
    }
  }
}

// ---- the step ----

void Lifecycle::begin(Time now) {
  now_ = std::max(now_, now);
  if (!step_was_read_) return;
  step_was_read_ = false;
  events_.clear();
  dispatches_.clear();
}

Step Lifecycle::step() {
  step_was_read_ = true;
  return Step{dispatches_, events_};
}

void Lifecycle::start(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level) {
  Job &job = jobs_[slot];
  TaskState &task = tasks_[job.task.value];
  --task.ready_count;
  --dag_states_[task.dag.value].pending;
  job.state = JobState::Running;
  job.worker = worker;
  emit(job, JobEventKind::Dispatched, job.deadline);
  tell(slot, DispatchKind::Start, over, level);
}

void Lifecycle::suspend(std::uint32_t slot) {
  Job &job = jobs_[slot];
  job.state = JobState::Suspended;
  emit(job, JobEventKind::Preempted, 0);
}

void Lifecycle::resume(std::uint32_t slot, WorkerId worker, std::uint32_t over, std::uint32_t level) {
  Job &job = jobs_[slot];
  job.state = JobState::Running;
  job.worker = worker;
  emit(job, JobEventKind::Resumed, 0);
  tell(slot, DispatchKind::Resume, over, level);
}

void Lifecycle::change_level(std::uint32_t slot, std::uint32_t level) {
  // A newer level change replaces an earlier one of the same step. Therefore no step outgrows its storage.
  std::erase_if(dispatches_,
                [slot](const Dispatch &d) { return d.kind == DispatchKind::Level && d.job == JobSlot(slot); });
  tell(slot, DispatchKind::Level, kNil, level);
}

void Lifecycle::tell(std::uint32_t slot, DispatchKind kind, std::uint32_t over, std::uint32_t level) {
  const Job &job = jobs_[slot];
  dispatches_.push_back(Dispatch{.job = JobSlot(slot),
                                 .task = job.task,
                                 .number = job.number,
                                 .release = job.release,
                                 .worker = job.worker,
                                 .over = over == kNil ? JobSlot() : JobSlot(over),
                                 .kind = kind,
                                 .inherits = job.priority_of != job.task,
                                 .level = level});
}

void Lifecycle::defer(std::uint32_t slot) {
  Job &job = jobs_[slot];
  if (job.deferred) return;
  job.deferred = true;
  ++tasks_[job.task.value].deferred;
  emit(job, JobEventKind::Deferred, 0);
}

// `origin` is used for tasks without predecessors and for data tasks, whose data is already consumed.
void Lifecycle::admit(TaskId id, Time nominal, Time origin) {
  TaskState &task = tasks_[id.value];
  DagState &dag = dag_states_[task.dag.value];
  Job fresh;
  fresh.task = id;
  fresh.number = count_release(task);
  fresh.release = nominal;
  fresh.deadline = nominal + task.deadline;
  emit(fresh, JobEventKind::Released, nominal);

  if (takes_turns_) fresh.turn = turn_of(task, nominal);
  if (task.waiting != kNil) skip(task.waiting, Reason::Precedence);
  if (task.queue_depth == 0 && task.ready_count > 0) {
    skip(task.latest_ready, Reason::Overrun);
    if (task.timer && task.joined) precedence_.give_back(id);
  }
  const bool has_data = task.timer && task.joined && precedence_.has_predecessors(id);
  const bool complete_set = !has_data || precedence_.on_release(id, nominal);
  const bool queue_is_full = task.queue_depth > 0 && task.ready_count >= task.queue_depth;
  const bool dag_is_full = dag.max_pending > 0 && dag.pending >= dag.max_pending;
  if (queue_is_full || dag_is_full) {
    ++task.skipped;
    emit(fresh, JobEventKind::Skipped, 0, queue_is_full ? Reason::QueueFull : Reason::DagFull);
    return;
  }

  const std::uint32_t slot = take_slot(task);
  jobs_[slot] = fresh;
  ++dag.pending;
  if (complete_set) {
    make_ready(slot, has_data ? precedence_.consume(id).origin : origin);
  } else {
    jobs_[slot].state = JobState::Waiting;
    task.waiting = slot;
  }
}

// Returns the turn of the task's next job (Ties::Share). A job that replaces another takes its turn: with its own,
// later release, each replacement would put the task behind its equals for ever. A queued job never comes before an
// earlier job of its task.
Time Lifecycle::turn_of(const TaskState &task, Time release) const {
  if (task.waiting != kNil) return jobs_[task.waiting].turn;
  if (task.ready_count == 0) return release;
  const Time earlier = jobs_[task.latest_ready].turn;
  return task.queue_depth == 0 ? earlier : std::max(release, earlier);
}

void Lifecycle::make_ready(std::uint32_t slot, Time origin) {
  Job &job = jobs_[slot];
  TaskState &task = tasks_[job.task.value];
  if (task.waiting == slot) task.waiting = kNil;
  ++task.ready_count;
  task.latest_ready = slot;
  job.state = JobState::Ready;
  job.origin = origin;
  job.sequence = next_sequence_++;
  job.priority_of = job.task;
  job.rank = task.rank;
  switch (config_.policy) {
    case PolicyKind::Edf: job.key = task.degraded ? kDemotedKey : job.deadline; break;
    case PolicyKind::Fifo: job.key = task.degraded ? kDemotedKey : static_cast<std::int64_t>(job.sequence); break;
    default: job.key = task.key; break;
  }
  emit(job, JobEventKind::Ready, origin);
  on_ready(slot);
}

void Lifecycle::skip(std::uint32_t slot, Reason reason) {
  Job &job = jobs_[slot];
  TaskState &task = tasks_[job.task.value];
  if (job.state == JobState::Ready) {
    on_withdrawn(slot);
    --task.ready_count;
  } else {
    task.waiting = kNil;
  }
  --dag_states_[task.dag.value].pending;
  ++task.skipped;
  emit(job, JobEventKind::Skipped, 0, reason);
  free_slot(slot);
}

std::uint32_t Lifecycle::new_slot() {
  if (free_slots_.empty()) {
    jobs_.emplace_back();
    return static_cast<std::uint32_t>(jobs_.size() - 1);
  }
  const std::uint32_t slot = free_slots_.back();
  free_slots_.pop_back();
  return slot;
}

std::uint32_t Lifecycle::take_slot(TaskState &task) {
  if (task.free_slot == kNil && task.queue_depth == kUnboundedQueue) return new_slot();
  const std::uint32_t slot = task.free_slot;
  REDAG_CHECK(slot != kNil, "a task has more jobs than its overrun rule allows");
  task.free_slot = jobs_[slot].next;
  return slot;
}

void Lifecycle::free_slot(std::uint32_t slot) {
  TaskState &task = tasks_[jobs_[slot].task.value];
  jobs_[slot].state = JobState::Free;
  jobs_[slot].next = task.free_slot;
  task.free_slot = slot;
}

void Lifecycle::emit(const Job &job, JobEventKind kind, std::int64_t value, Reason reason) {
  events_.push_back(JobEvent{now_, value, job.task, job.number, job.worker.value, kind, reason, 0});
}

}  // namespace redag::sched
