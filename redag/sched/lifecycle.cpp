#include "redag/sched/lifecycle.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::sched {

void Lifecycle::release(TaskId task, Time nominal, Time now) {
  REDAG_CHECK(task.value < tasks_.size(), "release of a task that does not exist");
  REDAG_CHECK(tasks_[task.value].timer, "data tasks are released by their predecessors");
  begin(now);
  if (!tasks_[task.value].removed) admit(task, nominal, nominal);
}

void Lifecycle::complete(JobSlot job_slot, Time now, Outcome outcome) {
  REDAG_CHECK(job_slot.value < jobs_.size() && jobs_[job_slot.value].started(),
              "completion of a job that does not run");
  begin(now);
  const std::uint32_t slot = job_slot.value;
  const Job job = jobs_[slot];
  TaskState &task = tasks_[job.task.value];
  if (outcome == Outcome::Finished) {
    ++task.accounting.finished;
    emit(job, JobEventKind::Finished, now);
  } else {
    ++task.accounting.aborted;
    emit(job, JobEventKind::Aborted, now, outcome == Outcome::Threw ? Reason::Exception : Reason::Budget);
  }
  on_end(slot);
  free_slot(slot);
  if (outcome != Outcome::Finished || task.removed) return;

  precedence_.on_complete(job.task, job.release, job.origin, [&](TaskId successor) {
    const TaskState &next = tasks_[successor.value];
    if (!next.timer) {
      admit(successor, now, precedence_.consume(successor));
    } else if (next.waiting != kNil) {
      make_ready(next.waiting, precedence_.consume(successor));
    }
  });
}

DagId Lifecycle::add_dag(const Dag &dag, Time now) {
  begin(now);
  append(dag);
  prioritise();
  on_reconfigured();
  return DagId(dag_states_.size() - 1);
}

void Lifecycle::remove_dag(DagId dag, Time now) {
  REDAG_CHECK(dag.value < dag_states_.size(), "removal of a DAG that does not exist");
  begin(now);
  const DagState &state = dag_states_[dag.value];
  for (std::uint32_t t = state.first_task; t < state.first_task + state.task_count; ++t) {
    TaskState &task = tasks_[t];
    task.removed = true;
    for (std::uint32_t slot = task.first_slot; slot < task.first_slot + task.slot_count; ++slot) {
      const JobState job_state = jobs_[slot].state;
      if (job_state == JobState::Waiting || job_state == JobState::Ready) skip(slot, Reason::Removed);
    }
  }
}

void Lifecycle::load(const Workload &workload) {
  for (const Dag &dag : workload.dags) append(dag);
  prioritise();
  on_reconfigured();
}

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
  emit(job, JobEventKind::Dispatched, job.release + task.deadline);
  dispatches_.push_back(
      Dispatch{JobSlot(slot), job.task, job.number, worker, over == kNil ? JobSlot() : JobSlot(over), false, level});
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
  dispatches_.push_back(
      Dispatch{JobSlot(slot), job.task, job.number, worker, over == kNil ? JobSlot() : JobSlot(over), true, level});
}

void Lifecycle::change_level(std::uint32_t slot, std::uint32_t level) {
  const Job &job = jobs_[slot];
  dispatches_.push_back(Dispatch{JobSlot(slot), job.task, job.number, job.worker, JobSlot(), true, level});
}

void Lifecycle::defer(std::uint32_t slot) {
  Job &job = jobs_[slot];
  if (job.deferred) return;
  job.deferred = true;
  ++tasks_[job.task.value].accounting.deferred;
  emit(job, JobEventKind::Deferred, 0);
}

// `origin` counts for tasks without predecessors and for data tasks, whose data is already consumed.
void Lifecycle::admit(TaskId id, Time nominal, Time origin) {
  TaskState &task = tasks_[id.value];
  DagState &dag = dag_states_[task.dag.value];
  Job fresh;
  fresh.task = id;
  fresh.number = task.next_number++;
  fresh.release = nominal;
  ++task.accounting.released;
  emit(fresh, JobEventKind::Released, nominal);

  if (task.waiting != kNil) skip(task.waiting, Reason::Precedence);
  if (task.queue_depth == 0 && task.ready_count > 0) {
    skip(task.latest_ready, Reason::Overrun);
    if (task.timer) precedence_.give_back(id);
  }
  const bool complete_set = !task.timer || precedence_.on_release(id, nominal);
  const bool queue_is_full = task.queue_depth > 0 && task.ready_count >= task.queue_depth;
  const bool dag_is_full = dag.max_pending > 0 && dag.pending >= dag.max_pending;
  if (queue_is_full || dag_is_full) {
    ++task.accounting.skipped;
    emit(fresh, JobEventKind::Skipped, 0, queue_is_full ? Reason::QueueFull : Reason::DagFull);
    return;
  }

  const std::uint32_t slot = take_slot(task);
  jobs_[slot] = fresh;
  ++dag.pending;
  if (complete_set) {
    make_ready(slot, task.timer && precedence_.has_predecessors(id) ? precedence_.consume(id) : origin);
  } else {
    jobs_[slot].state = JobState::Waiting;
    task.waiting = slot;
  }
}

void Lifecycle::make_ready(std::uint32_t slot, Time origin) {
  Job &job = jobs_[slot];
  TaskState &task = tasks_[job.task.value];
  if (task.waiting == slot) task.waiting = kNil;
  ++task.ready_count;
  task.latest_ready = slot;
  job.state = JobState::Ready;
  job.ready = now_;
  job.origin = origin;
  job.sequence = next_sequence_++;
  job.priority_of = job.task;
  job.rank = task.priority.rank;
  switch (config_.policy) {
    case PolicyKind::Edf: job.key = job.release + task.deadline; break;
    case PolicyKind::Fifo: job.key = static_cast<std::int64_t>(job.sequence); break;
    default: job.key = task.priority.rank; break;
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
  ++task.accounting.skipped;
  emit(job, JobEventKind::Skipped, 0, reason);
  free_slot(slot);
}

void Lifecycle::append(const Dag &dag) {
  const auto task_count = static_cast<std::uint32_t>(dag.tasks.size());
  dag_states_.push_back(
      DagState{dag.max_active, dag.max_pending, 0, static_cast<std::uint32_t>(tasks_.size()), task_count});
  for (const Task &task : dag.tasks) {
    REDAG_CHECK(task.period > 0 && task.deadline > 0, "a task needs a period and a deadline (inherit_periods)");
    TaskState state;
    state.deadline = task.deadline;
    state.dag = DagId(dag_states_.size() - 1);
    state.queue_depth = task.overrun == Overrun::Queue ? std::max(1U, task.queue_depth) : 0;
    state.timer = task.activation == Activation::Timer;
    if (!task.group.empty()) {
      const auto next_position = static_cast<std::uint32_t>(group_positions_.size());
      state.group = group_positions_.try_emplace(task.group, next_position).first->second;
    }
    // One job that has started, the ready ones, and one that waits for its predecessors.
    state.first_slot = static_cast<std::uint32_t>(jobs_.size());
    state.slot_count = std::max(1U, state.queue_depth) + 2;
    jobs_.resize(jobs_.size() + state.slot_count);
    for (std::uint32_t slot = state.first_slot; slot < jobs_.size(); ++slot) {
      jobs_[slot].next = state.free_slot;
      state.free_slot = slot;
    }
    tasks_.push_back(state);
  }
  precedence_.add_dag(dag);
  dags_.push_back(dag);

  // Room for what one instant can bring: each task's release, the skip of its last job, readiness, deferral, start,
  // preemption.
  events_.reserve(6 * tasks_.size() + 64);
  dispatches_.reserve(2 * std::size_t{config_.workers} + 16);
}

void Lifecycle::prioritise() {
  const std::vector<Priority> priorities = assign_priorities(dags_, config_.policy, config_.levels);
  for (std::size_t i = 0; i < tasks_.size(); ++i) tasks_[i].priority = priorities[i];
  for (Job &job : jobs_) {
    if (job.state == JobState::Free || job.state == JobState::Waiting) continue;
    job.rank = tasks_[job.priority_of.value].priority.rank;
    if (is_static(config_.policy)) job.key = job.rank;
  }
}

std::uint32_t Lifecycle::take_slot(TaskState &task) {
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
