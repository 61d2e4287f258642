// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/replay.hpp"

#include <algorithm>
#include <limits>
#include <unordered_map>

namespace redag::metrics {

using State = LiveJob::State;

Replay::Replay(const Workload &workload, const sched::Config &config)
    : config_(config),
      priorities_(sched::assign_priorities(workload.dags, config.policy, config.ties, config.levels)),
      workers_(config.workers),
      free_workers_(config.workers) {
  const auto lowest = config.levels > 0 ? config.levels : static_cast<std::uint32_t>(priorities_.size());
  level_of_key_.assign(2 * priorities_.size(), lowest);
  for (const sched::Priority &priority : priorities_) level_of_key_[priority.tier] = priority.level;
  std::unordered_map<std::string, std::uint32_t> group_ids;
  for (const Dag &dag : workload.dags) {
    Shared shared;
    shared.capacity = dag.max_active;
    shared.degradable = dag.criticality != Criticality::High;
    for (const redag::Task &task : dag.tasks) {
      TaskState state;
      state.task = &task;
      state.dag = DagId(dags_.size());
      const TaskId id(tasks_.size());
      if (!task.group.empty()) {
        state.group = group_ids.try_emplace(task.group, static_cast<std::uint32_t>(groups_.size())).first->second;
        if (state.group == groups_.size()) groups_.push_back(Shared{0, 0, 1, {}, false});
        groups_[state.group].tasks.push_back(id);
      }
      shared.tasks.push_back(id);
      tasks_.push_back(std::move(state));
    }
    dags_.push_back(std::move(shared));
  }
}

LiveJob *Replay::find_mutable(TaskId task, std::uint32_t number) {
  for (LiveJob &job : tasks_[task.value].live) {
    if (job.number == number) return &job;
  }
  return nullptr;
}

const LiveJob *Replay::find(TaskId task, std::uint32_t number) const {
  for (const LiveJob &job : tasks_[task.value].live) {
    if (job.number == number) return &job;
  }
  return nullptr;
}

const char *Replay::apply(const JobEvent &event) {
  if (is_mode_change(event.kind)) return change_mode(event);
  if (event.kind == JobEventKind::Released) {
    if (find(event.task, event.job) != nullptr) return "it was released before";
    LiveJob job;
    job.task = event.task;
    job.number = event.job;
    job.release = event.value;
    job.deadline = event.value + task(event.task).deadline;
    if (waits_for_data(event.task)) job.turn = job.release;
    for (const LiveJob &other : tasks_[event.task.value].live) {
      if (other.state == State::Ready) job.turn = std::max(job.turn, other.turn);
    }
    tasks_[event.task.value].live.push_back(job);
    ++dags_[dag_of(event.task).value].pending;
    return nullptr;
  }
  LiveJob *job = find_mutable(event.task, event.job);
  return job == nullptr ? "there is no job of this number that is released and not ended" : apply_to(*job, event);
}

const char *Replay::apply_to(LiveJob &job, const JobEvent &event) {
  const State before = job.state;
  const char *problem = nullptr;
  switch (event.kind) {
    case JobEventKind::Released: break;
    case JobEventKind::Ready:
      if (before != State::Waiting) return "it was ready before";
      job.origin = event.value;
      if (!job.replaces && !waits_for_data(job.task)) job.turn = std::max(job.turn, job.origin);
      job.own = urgency_of(job);
      job.raised = job.own;
      move_to(job, State::Ready);
      return nullptr;
    case JobEventKind::Deferred:
      if (before != State::Ready) return "only a ready job can be deferred";
      if (job.deferred) return "it was deferred before";
      job.deferred = true;
      refresh(job.task);
      return nullptr;
    case JobEventKind::Dispatched:
      if (job.started()) return "it had started before";
      if (before == State::Waiting) {
        problem = "it was dispatched before it was ready";
        job.own = urgency_of(job);
        job.raised = job.own;
      }
      if (const char *worker_problem = take_worker(job, event)) problem = worker_problem;
      move_to(job, State::Running);
      return problem;
    case JobEventKind::Started:
      if (!job.started()) return "its body began before it was dispatched";
      if (job.body_began) return "its body began twice";
      job.body_began = true;
      return nullptr;
    case JobEventKind::Executed:
      if (!job.started()) return "its body ended, and it was not dispatched";
      if (job.executed_seen) return "its body ended twice";
      job.executed_seen = true;
      return event.value >= 0 ? nullptr : "it used a negative amount of processor time";
    case JobEventKind::Exceeded:
      if (!job.started()) return "a job that has not started cannot use up its budget";
      if (job.exceeded) return "it used up its budget before";
      job.exceeded = true;
      if (task(job.task).on_budget == OnBudget::Demote) demote(job, false);
      return nullptr;
    case JobEventKind::HighMode:
    case JobEventKind::LowMode: break;
    case JobEventKind::Preempted:
      if (before != State::Running) return "only a running job can be preempted";
      job.executed += event.time - job.on_worker_since;
      if (config_.preemption == sched::Preemption::Full) {
        problem = leave_worker(job);
        suspended_.push_back(JobRef{job.task, job.number});
      }
      move_to(job, State::Suspended);
      return problem;
    case JobEventKind::Resumed:
      if (before != State::Suspended && before != State::Woken) return "only a preempted or woken job can be resumed";
      problem = take_worker(job, event);
      move_to(job, State::Running);
      return problem;
    case JobEventKind::Waits: return begin_wait(job, event);
    case JobEventKind::Served:
      if (before != State::AtDevice) return "a device served it that it had not asked";
      if (event.value != job.device) problem = "another device served it than the one that it had asked";
      move_to(job, State::Away);
      return problem;
    case JobEventKind::Woken:
      if (before != State::Away) return "it was woken, but did not wait or was not served";
      suspended_.push_back(JobRef{job.task, job.number});
      move_to(job, State::Woken);
      return nullptr;
    case JobEventKind::Finished:
    case JobEventKind::Aborted:
      if (!job.started()) problem = "it ended without having started";
      if (before == State::Running) job.executed += event.value - job.on_worker_since;
      if (job.started()) {
        if (const char *worker_problem = leave_worker(job)) problem = worker_problem;
      }
      erase(event.task, event.job);
      return problem;
    case JobEventKind::Skipped:
      if (job.started()) {
        problem = "a job that has started cannot be skipped";
        leave_worker(job);
      }
      hand_turn_on(job, event.reason);
      erase(event.task, event.job);
      return problem;
  }
  return "the kind of the event is unknown";
}

// On real threads, with full preemption, the operating system runs jobs that count as preempted.
const char *Replay::begin_wait(LiveJob &job, const JobEvent &event) {
  const bool may_run_unseen =
      config_.preemption == sched::Preemption::Full && (job.state == State::Suspended || job.state == State::Woken);
  if (job.state != State::Running && !may_run_unseen) return "only a running job can wait";
  if (job.state == State::Running) job.executed += event.time - job.on_worker_since;
  const char *problem = leave_worker(job);
  job.device = event.value;
  ++job.waits;
  move_to(job, event.value < 0 ? State::Away : State::AtDevice);
  return problem;
}

// True for a timer task with predecessors: the turn of its jobs is their release, not the origin of their data.
bool Replay::waits_for_data(TaskId id) const {
  return task(id).activation == Activation::Timer && !task(id).predecessors.empty();
}

// A job that replaces one that has not started also takes its turn.
void Replay::hand_turn_on(const LiveJob &skipped, Reason reason) {
  if (reason != Reason::Overrun && reason != Reason::Precedence) return;
  LiveJob &newest = tasks_[skipped.task.value].live.back();
  if (newest.number == skipped.number || newest.state != State::Waiting) return;
  newest.turn = skipped.turn;
  newest.replaces = true;
}

// Demotes started jobs of lower criticality; the others are to be skipped.
const char *Replay::change_mode(const JobEvent &event) {
  const bool begins = event.kind == JobEventKind::HighMode;
  if (begins == high_mode()) return begins ? "HI mode has begun before" : "HI mode has ended before";
  high_since_ = begins ? event.time : kNever;
  if (!begins) return nullptr;
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    if (!is_degradable(TaskId(t))) continue;
    for (LiveJob &job : tasks_[t].live) {
      if (job.started()) demote(job, true);
    }
  }
  return nullptr;
}

// The job loses what it inherited, and inherits from jobs that still wait for its group. When HI mode begins, those of
// lower criticality go away.
void Replay::demote(LiveJob &job, bool by_mode) {
  if (job.demoted) return;
  job.demoted = true;
  job.own.key = demoted_key(job.task);
  job.raised = job.own;
  const std::uint32_t group = group_of(job.task);
  if (group == kNoGroup || config_.policy == PolicyKind::Fifo) return;
  for (const TaskId sharer : groups_[group].tasks) {
    const TaskState &task = tasks_[sharer.value];
    const bool goes_away = by_mode && is_degradable(sharer);
    if (task.gate == Gate::Group && !goes_away) job.raised.key = std::min(job.raised.key, task.waiter.urgency.key);
  }
}

std::int64_t Replay::demoted_key(TaskId task) const {
  return is_static(config_.policy) ? static_cast<std::int64_t>(tasks_.size() + priorities_[task.value].tier)
                                   : std::numeric_limits<std::int64_t>::max();
}

// Puts the job on the event's worker; a resumed job leaves the suspended ones.
const char *Replay::take_worker(LiveJob &job, const JobEvent &event) {
  const JobRef ref{job.task, job.number};
  std::erase(suspended_, ref);
  job.on_worker_since = event.time;
  if (event.worker >= workers_.size()) return "there is no such worker";
  std::vector<JobRef> &stack = workers_[event.worker];
  if (job.state == State::Suspended && !stack.empty() && stack.back() == ref)
    return nullptr;  // Cooperative: it
                     // continues

  const char *problem = nullptr;
  if (job.state == State::Suspended && config_.preemption == sched::Preemption::Cooperative) {
    problem = "a suspended job can resume only on its worker, after the job on top of it has ended";
    leave_worker(job);
  }
  if (running(event.worker) != nullptr) problem = "the worker runs another job";
  if (stack.empty()) --free_workers_;
  stack.push_back(ref);
  job.worker = event.worker;
  return problem;
}

const char *Replay::leave_worker(const LiveJob &job) {
  const JobRef ref{job.task, job.number};
  const char *problem = nullptr;
  for (std::vector<JobRef> &stack : workers_) {
    const auto found = std::find(stack.begin(), stack.end(), ref);
    if (found == stack.end()) continue;
    if (found + 1 != stack.end()) problem = "it left its worker under a job that runs on top of it";
    stack.erase(found);
    if (stack.empty()) ++free_workers_;
    return problem;
  }
  std::erase(suspended_, ref);
  return nullptr;
}

// Changes the state and updates all counts; no other code changes them.
void Replay::move_to(LiveJob &job, State state) {
  const bool was_started = job.started();
  const bool was_ended = job.state == State::Ended;
  job.state = state;
  const bool is_pending_now = state == State::Waiting || state == State::Ready;
  TaskState &task = tasks_[job.task.value];
  Shared &dag = dags_[task.dag.value];
  if (!was_started && !was_ended && !is_pending_now) --dag.pending;
  if (was_started == job.started()) {
    refresh(job.task);
    return;
  }
  const auto step = [&](std::uint32_t &count) { count = job.started() ? count + 1 : count - 1; };
  step(task.active);
  step(dag.active);
  step(started_);
  if (task.group != kNoGroup) step(groups_[task.group].active);
  refresh_sharers(job.task);
}

void Replay::erase(TaskId task, std::uint32_t number) {
  move_to(*find_mutable(task, number), State::Ended);
  std::erase_if(tasks_[task.value].live, [](const LiveJob &job) { return job.state == State::Ended; });
  refresh(task);
}

Replay::Gate Replay::gate_of(const TaskState &task, const LiveJob *&first) const {
  for (const LiveJob &job : task.live) {
    if (job.state != State::Ready) continue;
    first = &job;
    break;
  }
  if (first == nullptr) return Gate::NoJob;
  if (task.active >= task.task->concurrency) return Gate::Task;
  const Shared &dag = dags_[task.dag.value];
  if (dag.capacity > 0 && dag.active >= dag.capacity) return Gate::Dag;
  return task.group != kNoGroup && groups_[task.group].active > 0 ? Gate::Group : Gate::Open;
}

void Replay::refresh(TaskId id) {
  TaskState &task = tasks_[id.value];
  const LiveJob *first = nullptr;
  const Gate gate = gate_of(task, first);
  const Waiter waiter = first == nullptr ? Waiter{} : Waiter{first->own, id, first->number};
  if (task.gate == Gate::Open && (gate != Gate::Open || waiter != task.waiter)) eligible_.erase(task.waiter);
  if (gate == Gate::Open && (task.gate != Gate::Open || waiter != task.waiter)) eligible_.insert(waiter);
  const bool group_is_free = task.group == kNoGroup || groups_[task.group].active == 0;
  if (gate == Gate::Dag && group_is_free && !first->deferred) {
    owed_deferral_.insert(id);
  } else {
    owed_deferral_.erase(id);
  }
  task.gate = gate;
  task.waiter = waiter;
  if (gate != Gate::Group || config_.policy == PolicyKind::Fifo) return;
  for (const TaskId sharer : groups_[task.group].tasks) {
    for (LiveJob &job : tasks_[sharer.value].live) {
      if (job.started()) job.raised.key = std::min(job.raised.key, first->own.key);
    }
  }
}

// Updates the sharers when a job starts or ends: the gates of its task, DAG and group may have changed.
void Replay::refresh_sharers(TaskId id) {
  refresh(id);
  const TaskState &task = tasks_[id.value];
  const Shared &dag = dags_[task.dag.value];
  if (dag.capacity > 0) {
    for (const TaskId sharer : dag.tasks) refresh(sharer);
  }
  if (task.group != kNoGroup) {
    for (const TaskId sharer : groups_[task.group].tasks) refresh(sharer);
  }
}

Urgency Replay::urgency_of(const LiveJob &job) {
  const bool takes_turns = config_.ties == Ties::Share && config_.policy != PolicyKind::Fifo;
  Urgency urgency;
  urgency.turn = takes_turns ? job.turn : 0;
  urgency.rank = priorities_[job.task.value].rank;
  urgency.sequence = next_sequence_++;
  urgency.key = high_mode() && is_degradable(job.task) ? demoted_key(job.task)
                                                       : undemoted_key(job.task, job.deadline, urgency.sequence);
  return urgency;
}

std::int64_t Replay::undemoted_key(TaskId task, Time deadline, std::uint64_t sequence) const {
  switch (config_.policy) {
    case PolicyKind::Edf: return deadline;
    case PolicyKind::Fifo: return static_cast<std::int64_t>(sequence);
    default: return priorities_[task.value].tier;
  }
}

bool Replay::is_passed_by_demotion(const LiveJob &job, const LiveJob &other) const {
  const auto key = [this](const LiveJob &one) { return undemoted_key(one.task, one.deadline, one.own.sequence); };
  return is_demoted(job) && !is_demoted(other) && key(job) <= key(other);
}

const LiveJob *Replay::running(std::uint32_t worker) const {
  const std::vector<JobRef> &stack = workers_[worker];
  if (stack.empty()) return nullptr;
  const LiveJob *top = find(stack.back().task, stack.back().number);
  return top != nullptr && top->state == State::Running ? top : nullptr;
}

template <class Predicate>
Urgency Replay::inherited_from(const LiveJob &job, Predicate hands_on) const {
  Urgency urgency = job.own;
  const std::uint32_t group = group_of(job.task);
  if (group == kNoGroup || !job.started() || config_.policy == PolicyKind::Fifo) return urgency;
  for (const TaskId sharer : groups_[group].tasks) {
    const TaskState &task = tasks_[sharer.value];
    if (task.gate != Gate::Group || !hands_on(task.waiter.urgency)) continue;
    urgency.key = std::min(urgency.key, task.waiter.urgency.key);
  }
  return urgency;
}

Urgency Replay::inherited(const LiveJob &job) const {
  return inherited_from(job, [](const Urgency &) { return true; });
}

Urgency Replay::inherited(const LiveJob &job, const Urgency &looked_at, bool started) const {
  return inherited_from(job, [&](const Urgency &waiter) { return goes_first(waiter, false, looked_at, started); });
}

std::uint32_t Replay::level_of(const Urgency &urgency) const {
  return level_of_key_[static_cast<std::size_t>(urgency.key)];
}

bool Replay::preempts(const Urgency &urgency, const Urgency &running) const {
  switch (config_.policy) {
    case PolicyKind::Edf:
      if (config_.ties == Ties::Share) return urgency.key < running.key;
      return urgency < running && urgency.key != demoted_key(TaskId(0));
    case PolicyKind::Fifo: return false;  // a job that became ready later never preempts
    default: return level_of(urgency) < level_of(running);
  }
}

bool Replay::goes_first(const Urgency &urgency, bool started, const Urgency &other, bool other_started) const {
  const bool has_levels = config_.preemption == sched::Preemption::Full && is_static(config_.policy);
  if (!has_levels || started == other_started) return urgency < other;
  const std::uint32_t level = level_of(urgency);
  const std::uint32_t other_level = level_of(other);
  return level != other_level ? level < other_level : started;
}

}  // namespace redag::metrics
