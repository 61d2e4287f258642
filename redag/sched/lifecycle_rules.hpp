// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The definitions of Lifecycle: jobs from release to end, and reconfiguration.
#pragma once

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/sched/lifecycle.hpp"
#include "redag/sched/lifecycle_overload.hpp"

namespace redag::sched {

template <Dispatcher D>
void Lifecycle<D>::release(TaskId task, Time nominal, Time now, Time origin) {
  REDAG_CHECK(table_.has(task), "release of a task that does not exist");
  REDAG_CHECK(table_.tasks[task.value].timer, "data tasks are released by their predecessors");
  table_.step.begin(now);
  if (table_.tasks[task.value].life == TaskLife::Live) admit(task, nominal, origin);
}

template <Dispatcher D>
void Lifecycle<D>::receive(TaskId task, TaskId sender, Time at, Time now, Time origin) {
  REDAG_CHECK(table_.has(task), "a message for a task that does not exist");
  REDAG_CHECK(!table_.tasks[task.value].timer && !table_.tasks[task.value].on_grid,
              "only data tasks that were added alone have messages");
  table_.step.begin(now);
  if (takes_releases(table_.tasks[task.value]) && table_.precedence.on_message(task, sender, at, origin))
    use_data(task);
}

template <Dispatcher D>
void Lifecycle<D>::miss(TaskId id, Time nominal, Time now, Reason reason) {
  REDAG_CHECK(table_.has(id), "release of a task that does not exist");
  TaskState &task = table_.tasks[id.value];
  REDAG_CHECK(task.timer, "data tasks are released by their predecessors");
  table_.step.begin(now);
  if (!takes_releases(task)) return;
  const Reason refused = restricted_ ? refusal(task, nominal) : Reason::None;
  refuse(id, nominal, refused == Reason::None ? reason : refused);
}

template <Dispatcher D>
void Lifecycle<D>::refuse(TaskId id, Time nominal, Reason reason) {
  TaskState &task = table_.tasks[id.value];
  const auto number = static_cast<std::uint32_t>(task.released++);
  table_.step.emit(id, number, WorkerId(), JobEventKind::Released, nominal);
  ++task.skipped;
  table_.step.emit(id, number, WorkerId(), JobEventKind::Skipped, 0, reason);
}

template <Dispatcher D>
void Lifecycle<D>::complete(JobSlot job, Time now, Outcome outcome) {
  REDAG_CHECK(table_.has(job) && table_.jobs[job.value].started(), "completion of a job that does not run");
  table_.step.begin(now);
  end(job.value, now, outcome);
}

template <Dispatcher D>
void Lifecycle<D>::end(std::uint32_t slot, Time now, Outcome outcome) {
  const Job &job = table_.jobs[slot];
  TaskState &task = table_.task_of(job);
  if (outcome == Outcome::Finished) {
    ++task.finished;
    table_.step.emit(job, JobEventKind::Finished, now);
  } else {
    ++task.aborted;
    if (outcome == Outcome::NoData) ++task.no_data;
    table_.step.emit(job, JobEventKind::Aborted, now, reason_of(outcome));
  }
  // The job used its budget and ended at one instant: drop its pending level change.
  table_.step.drop(JobSlot(slot));
  dispatcher_.on_end(slot);
  table_.free_slot(slot, task);
  if (outcome != Outcome::Finished || !task.joined || !takes_releases(task)) return;

  table_.precedence.on_complete(job.task, job.release, job.origin, now,
                                [this](TaskId successor) { use_data(successor); });
}

// All data of the task is fresh: releases its job, or makes the one that waits for the data ready.
template <Dispatcher D>
void Lifecycle<D>::use_data(TaskId id) {
  const TaskState &task = table_.tasks[id.value];
  if (task.life != TaskLife::Live) return;
  if (!task.timer) {
    const Precedence::Data data = table_.precedence.consume(id);
    admit(id, data.complete, data.origin);
  } else if (task.waiting != kNil) {
    const bool has_data = table_.precedence.has_predecessors(id);
    make_ready(task.waiting, has_data ? table_.precedence.consume(id).origin : table_.jobs[task.waiting].release);
  }
}

template <Dispatcher D>
void Lifecycle<D>::preemption_point(JobSlot job, Time now) {
  REDAG_CHECK(table_.config.preemption == Preemption::Cooperative, "preemption points are for cooperative preemption");
  table_.step.begin(now);
  REDAG_CHECK(table_.jobs[job.value].state == JobState::Running, "a preemption point of a job that does not run");
  dispatcher_.on_preemption_point(job.value);
}

template <Dispatcher D>
void Lifecycle<D>::wait(JobSlot job, DeviceId device, Time now) {
  if constexpr (LetsWait<D>) {
    REDAG_CHECK(table_.has(job), "a job waits that does not exist");
    REDAG_CHECK(!device.valid() || device.value < table_.devices.size(),
                "a job waits for a device that does not exist");
    table_.step.begin(now);
    dispatcher_.on_wait(job.value, device);
  } else {
    Scheduler::wait(job, device, now);
  }
}

template <Dispatcher D>
void Lifecycle<D>::wake(JobSlot job, Time now) {
  if constexpr (LetsWait<D>) {
    REDAG_CHECK(table_.has(job) && table_.jobs[job.value].state == JobState::Away, "a job wakes that no device serves");
    table_.step.begin(now);
    dispatcher_.on_wake(job.value);
  } else {
    Scheduler::wake(job, now);
  }
}

template <Dispatcher D>
Step Lifecycle<D>::dispatch(Time now, std::uint32_t most) {
  table_.step.begin(now);
  return take_step(most);
}

template <Dispatcher D>
Step Lifecycle<D>::take_step(std::uint32_t most) {
  dispatcher_.decide(most);
  if (table_.high_mode && dispatcher_.is_idle()) leave_high_mode();
  return table_.step.read();
}

template <Dispatcher D>
Step Lifecycle<D>::finish(JobSlot job, Time now, Outcome outcome, std::uint32_t most) {
  REDAG_CHECK(table_.has(job) && table_.jobs[job.value].started(), "completion of a job that does not run");
  if constexpr (HandsOver<D>) {
    if (outcome == Outcome::Finished && !restricted_ && hand_over(job.value, now, most)) return table_.step.read();
  }
  table_.step.begin(now);
  end(job.value, now, outcome);
  return take_step(most);
}

// Direct hand-over: the job releases one data task and nothing else depends on its end, so that the new job takes its
// place without a queue and without a search for a worker. The result is that of complete() and dispatch(). Returns
// false, with nothing done, in all other cases. Not constrained: clang 14 instantiates it for other dispatchers as
// well.
template <Dispatcher D>
bool Lifecycle<D>::hand_over(std::uint32_t slot, Time now, std::uint32_t most) {
  if constexpr (HandsOver<D>) {
    const Job &job = table_.jobs[slot];
    const TaskId heir = table_.precedence.heir(job.task);
    if (!heir.valid() || most == 0) return false;
    TaskState &task = table_.tasks[job.task.value];
    TaskState &next = table_.tasks[heir.value];
    if (next.ready_count > 0 || !table_.step.is_new()) return false;
    if (!dispatcher_.can_replace(job, heir)) return false;

    table_.step.begin(now);
    ++task.finished;
    const Precedence::Data data = table_.precedence.hand_on(job.task, job.release, job.origin, now);
    REDAG_CHECK(next.free_slot != kNil, "a task without a waiting or ready job has no free slot");
    const std::uint32_t its_slot =
        add_ready_job(heir, next, data.complete, data.origin, takes_turns_ ? data.origin : 0);
    if (table_.step.records(JobEventKind::Finished) || table_.step.records(JobEventKind::Released) ||
        table_.step.records(JobEventKind::Ready)) {
      tell_hand_over(job, table_.jobs[its_slot], now);
    }
    dispatcher_.replace(slot, its_slot, most);
    table_.free_slot(slot, task);
    return true;
  }
  return false;
}

// One call for all three events: without a trace, hand_over() is shorter by more than the checks.
template <Dispatcher D>
[[gnu::noinline]] void Lifecycle<D>::tell_hand_over(const Job &ended, const Job &next, Time now) {
  table_.step.emit(ended, JobEventKind::Finished, now);
  table_.step.emit(next, JobEventKind::Released, next.release);
  table_.step.emit(next, JobEventKind::Ready, next.origin);
}

template <Dispatcher D>
bool Lifecycle<D>::outranked(JobSlot job) const {
  return table_.config.preemption == Preemption::Cooperative && dispatcher_.outranked(table_.jobs[job.value]);
}

// A job that no rule concerns: its task has no other that has not started, and needs no data.
template <Dispatcher D>
void Lifecycle<D>::admit(TaskId id, Time nominal, Time origin) {
  TaskState &task = table_.tasks[id.value];
  if (restricted_ || task.is_special || task.ready_count > 0 || task.waiting != kNil) {
    return admit_by_rules(id, nominal, origin);
  }
  table_.step.emit(id, static_cast<std::uint32_t>(task.released), WorkerId(), JobEventKind::Released, nominal);
  const std::uint32_t slot = add_ready_job(id, task, nominal, origin, takes_turns_ ? origin : 0);
  table_.count_ready(task, slot);
  table_.step.emit(table_.jobs[slot], JobEventKind::Ready, origin);
  dispatcher_.on_ready(slot);
}

// A timer task with predecessors has its release as `origin` here, and gets that of its data when it is ready.
template <Dispatcher D>
[[gnu::noinline]] void Lifecycle<D>::admit_by_rules(TaskId id, Time nominal, Time origin) {
  if (closed_) return;
  TaskState &task = table_.tasks[id.value];
  if (restricted_) {
    if (const Reason reason = refusal(task, nominal); reason != Reason::None) return refuse(id, nominal, reason);
  }
  const DagState &dag = table_.dags[task.dag.value];
  const auto number = static_cast<std::uint32_t>(task.released);
  table_.step.emit(id, number, WorkerId(), JobEventKind::Released, nominal);

  const Time turn = takes_turns_ ? turn_of(task, origin) : 0;
  if (task.waiting != kNil) skip(task.waiting, Reason::Precedence);
  if (task.queue_depth == 0 && task.ready_count > 0) {
    skip(task.latest_ready, Reason::Overrun);
    if (task.timer && task.joined) table_.precedence.give_back(id);
  }
  const bool has_data = task.timer && task.joined && table_.precedence.has_predecessors(id);
  const bool complete_set = !has_data || table_.precedence.on_release(id, nominal);
  const bool queue_is_full = task.queue_depth > 0 && task.ready_count >= task.queue_depth;
  const bool dag_is_full = dag.max_pending > 0 && dag.pending >= dag.max_pending;
  if (queue_is_full || dag_is_full) {
    ++task.released;
    ++task.skipped;
    table_.step.emit(id, number, WorkerId(), JobEventKind::Skipped, 0,
                     queue_is_full ? Reason::QueueFull : Reason::DagFull);
    return;
  }

  const std::uint32_t slot = add_ready_job(id, task, nominal, origin, turn);
  table_.count_pending(task);
  table_.jobs[slot].state = JobState::Waiting;
  if (complete_set) return make_ready(slot, has_data ? table_.precedence.consume(id).origin : origin);
  task.waiting = slot;
}

// Gives the task's next job a slot, and its place in the order of jobs.
template <Dispatcher D>
std::uint32_t Lifecycle<D>::add_ready_job(TaskId id, TaskState &task, Time nominal, Time origin, Time turn) {
  const std::uint32_t slot = table_.take_slot(task);
  const Time deadline = nominal + task.deadline;
  table_.jobs[slot] = Job{.task = id,
                          .number = static_cast<std::uint32_t>(task.released++),
                          .release = nominal,
                          .deadline = deadline,
                          .origin = origin,
                          .key = key_of_next(task, deadline),
                          .turn = turn,
                          .sequence = next_sequence_++,
                          .rank = task.rank,
                          .priority_of = id,
                          .state = JobState::Ready};
  return slot;
}

// Returns the key of a job that becomes ready now, with `next_sequence_`.
template <Dispatcher D>
std::int64_t Lifecycle<D>::key_of_next(const TaskState &task, Time deadline) const {
  if (is_static(table_.config.policy)) return task.key;
  if (task.degraded) return table_.demoted_key(task);
  return table_.config.policy == PolicyKind::Edf ? deadline : static_cast<std::int64_t>(next_sequence_);
}

// Returns the turn of the task's next job (Ties::Share). A job that replaces another takes its turn: with its own,
// later origin, each replacement would put the task behind its equals for ever. A queued job never comes before an
// earlier job of its task.
template <Dispatcher D>
Time Lifecycle<D>::turn_of(const TaskState &task, Time origin) const {
  if (task.waiting != kNil) return table_.jobs[task.waiting].turn;
  if (task.ready_count == 0) return origin;
  const Time earlier = table_.jobs[task.latest_ready].turn;
  return task.queue_depth == 0 ? earlier : std::max(origin, earlier);
}

// The job, which waited for its data, gets its place in the order of jobs.
template <Dispatcher D>
void Lifecycle<D>::make_ready(std::uint32_t slot, Time origin) {
  Job &job = table_.jobs[slot];
  TaskState &task = table_.task_of(job);
  if (task.waiting == slot) task.waiting = kNil;
  table_.count_ready(task, slot);
  job.state = JobState::Ready;
  job.origin = origin;
  job.key = key_of_next(task, job.deadline);
  job.sequence = next_sequence_++;
  job.rank = task.rank;
  table_.step.emit(job, JobEventKind::Ready, origin);
  dispatcher_.on_ready(slot);
}

template <Dispatcher D>
void Lifecycle<D>::skip(std::uint32_t slot, Reason reason) {
  Job &job = table_.jobs[slot];
  TaskState &task = table_.tasks[job.task.value];
  if (job.state == JobState::Ready) {
    dispatcher_.on_withdrawn(slot);
    --task.ready_count;
  } else {
    task.waiting = kNil;
  }
  table_.count_no_longer_pending(task);
  ++task.skipped;
  table_.step.emit(job, JobEventKind::Skipped, 0, reason);
  table_.free_slot(slot, task);
}

template <Dispatcher D>
template <class Predicate>
void Lifecycle<D>::skip_all(Reason reason, Predicate which) {
  for (std::uint32_t slot = 0; slot < table_.jobs.size(); ++slot) {
    const JobState state = table_.jobs[slot].state;
    if ((state == JobState::Waiting || state == JobState::Ready) && which(table_.jobs[slot])) skip(slot, reason);
  }
}

// ---- reconfiguration ----

template <Dispatcher D>
void Lifecycle<D>::load(const Workload &workload) {
  table_.devices = workload.platform.devices;
  for (const Dag &dag : workload.dags) table_.append_dag(dag);
  reprioritise();
}

template <Dispatcher D>
DagId Lifecycle<D>::add_dag(const Dag &dag, Time now) {
  table_.step.begin(now);
  table_.collect();
  const DagId id = table_.append_dag(dag);
  reprioritise();
  return id;
}

template <Dispatcher D>
TaskId Lifecycle<D>::add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) {
  REDAG_CHECK(dag.value < table_.dags.size() && !table_.dags[dag.value].removed,
              "a task for a DAG that does not exist");
  REDAG_CHECK(task.predecessors.empty(), "a task that is added alone has no predecessors");
  table_.step.begin(now);
  table_.collect();
  const TaskId id = table_.append_task(dag, rank, task);
  if (!more) reprioritise();
  return id;
}

template <Dispatcher D>
void Lifecycle<D>::set_predecessors(TaskId id, std::span<const TaskId> predecessors, Time now) {
  REDAG_CHECK(id.value < table_.tasks.size() && !table_.tasks[id.value].on_grid,
              "new predecessors of a task that was not added alone");
  table_.step.begin(now);
  if (!predecessors.empty() && table_.tasks[id.value].timer) table_.tasks[id.value].is_special = true;
  for (const TaskId from : predecessors) {
    REDAG_CHECK(from != id && from.value < table_.tasks.size() && !table_.tasks[from.value].on_grid,
                "a predecessor that was not added alone");
    table_.tasks[from.value].joined = table_.tasks[id.value].joined = true;
  }
  const bool complete = table_.precedence.set_predecessors(id, predecessors);
  find_heirs();
  if (complete && takes_releases(table_.tasks[id.value])) use_data(id);
}

template <Dispatcher D>
void Lifecycle<D>::remove_dag(DagId dag, Time now) {
  REDAG_CHECK(dag.value < table_.dags.size(), "removal of a DAG that does not exist");
  table_.step.begin(now);
  table_.dags[dag.value].removed = true;
  for (const TaskId task : table_.dags[dag.value].tasks) {
    table_.tasks[task.value].life = TaskLife::Removed;
    forget_skip(table_.tasks[task.value]);
  }
  table_.has_removed = true;
  find_heirs();
  skip_all(Reason::Removed, [&](const Job &job) { return table_.tasks[job.task.value].dag == dag; });
}

template <Dispatcher D>
void Lifecycle<D>::remove_task(TaskId id, Time now) {
  REDAG_CHECK(table_.has(id), "removal of a task that does not exist");
  table_.step.begin(now);
  TaskState &task = table_.tasks[id.value];
  if (task.life != TaskLife::Live) return;
  task.life = TaskLife::Removed;
  table_.has_removed = true;
  forget_skip(task);
  if (task.joined) find_heirs();
  if (task.waiting == kNil && task.ready_count == 0) return;
  skip_all(Reason::Removed, [&](const Job &job) { return job.task == id; });
}

template <Dispatcher D>
void Lifecycle<D>::set_timing(TaskId task, Duration period, Duration deadline, Time now) {
  REDAG_CHECK(table_.has(task), "a new period for a task that does not exist");
  REDAG_CHECK(period > 0 && deadline > 0, "a task needs a period and a deadline");
  table_.step.begin(now);
  if (table_.tasks[task.value].life == TaskLife::Gone) return;
  table_.tasks[task.value].period = period;
  table_.tasks[task.value].deadline = deadline;
  table_.precedence.set_period(task, period);
  reprioritise();
}

template <Dispatcher D>
void Lifecycle<D>::reprioritise() {
  table_.prioritise();
  dispatcher_.on_reconfigured();
  find_heirs();
}

// Finds the tasks whose jobs can take the place of the job before. What does not change between two reconfigurations is
// checked here, and the rest by hand_over().
template <Dispatcher D>
void Lifecycle<D>::find_heirs() {
  if constexpr (HandsOver<D>) {
    table_.precedence.find_heirs([this](TaskId from, TaskId to) {
      const TaskState &next = table_.tasks[to.value];
      const bool both_live = table_.tasks[from.value].life == TaskLife::Live && next.life == TaskLife::Live;
      return both_live && table_.dags[next.dag.value].max_pending == 0 && dispatcher_.share_gates(from, to);
    });
  }
}

template <Dispatcher D>
void Lifecycle<D>::close(Time now) {
  table_.step.begin(now);
  closed_ = true;
  refresh_restricted();
  skip_all(Reason::Removed, [](const Job &) { return true; });
}

}  // namespace redag::sched
