// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/check_dispatch.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {

using sched::Preemption;
using State = LiveJob::State;

DispatchRules::DispatchRules(CheckContext &context) : context_(context) {
  for (const Dag &dag : context.info.workload.dags) {
    const auto first = static_cast<std::uint32_t>(places_.size());
    for (const std::uint32_t rank : topological_ranks(dag)) places_.push_back(first + rank);
  }
}

void DispatchRules::before(const JobEvent &event) {
  const LiveJob *job = context_.replay.find(event.task, event.job);
  if (job == nullptr) return;  // the replay reports it
  switch (event.kind) {
    case JobEventKind::Dispatched: dispatched(event, *job); break;
    case JobEventKind::Deferred: deferred(event); break;
    case JobEventKind::Preempted: preempted(event, *job); break;
    case JobEventKind::Resumed: resumed(event, *job); break;
    case JobEventKind::Finished:
    case JobEventKind::Aborted: ended(event, *job); break;
    default: break;
  }
}

void DispatchRules::dispatched(const JobEvent &event, const LiveJob &job) {
  // A job keeps the deadline that its task had when it was released.
  const bool had_another = context_.info.settled && job.release <= *context_.info.settled;
  context_.expect(Rule::Deadline, event.value == job.deadline || had_another, event.task, event.job, [&] {
    return "its deadline is " + format_duration(event.value) + ", but r + D is " + format_duration(job.deadline);
  });
  check_bounds(event);
  check_place(event, job);
  check_eviction(event, job);
  if (job.state == State::Ready) check_choice(job, job.own);
}

void DispatchRules::check_bounds(const JobEvent &event) {
  const Replay &replay = context_.replay;
  const DagId dag_id = replay.dag_of(event.task);
  const Dag &dag = context_.info.workload.dags[dag_id.value];
  const std::uint32_t concurrency = replay.task(event.task).concurrency;
  context_.expect(Rule::TaskOverlap, replay.task_active(event.task) < concurrency, event.task, event.job, [&] {
    return concurrency == 1 ? "another job of its task has started and not ended"
                            : std::to_string(replay.task_active(event.task)) +
                                  " jobs of its task have started and not ended; at most " +
                                  std::to_string(concurrency) + " are allowed";
  });
  const auto jobs = replay.jobs_of(event.task);
  const auto first = std::find_if(jobs.begin(), jobs.end(), [](const LiveJob &j) { return j.state == State::Ready; });
  context_.expect(Rule::TaskOverlap, first == jobs.end() || first->number == event.job, event.task, event.job,
                  [&] { return "job " + std::to_string(first->number) + " of its task was released earlier"; });
  if (dag.max_active > 0) {
    context_.expect(Rule::MaxActive, replay.active(dag_id) < dag.max_active, event.task, event.job, [&] {
      return "DAG " + dag.name + " has " + std::to_string(replay.active(dag_id)) + " jobs started; at most " +
             std::to_string(dag.max_active) + " are allowed";
    });
  }
  if (context_.info.config.max_started > 0) {
    context_.expect(Rule::MaxActive, replay.started() < context_.info.config.max_started, event.task, event.job,
                    [] { return std::string("max_started jobs had started"); });
  }
  const std::uint32_t group = replay.group_of(event.task);
  if (group != Replay::kNoGroup) {
    context_.expect(Rule::Group, replay.group_active(group) == 0, event.task, event.job, [&] {
      return "another job of group " + replay.task(event.task).group + " has started and not ended";
    });
  }
}

// Cooperative: a job starts on a free worker. If none is free, it starts on top of a suspended job that it outranks.
void DispatchRules::check_place(const JobEvent &event, const LiveJob &job) {
  const Replay &replay = context_.replay;
  if (mode() != Preemption::Cooperative || event.worker >= replay.worker_count()) return;
  const auto stack = replay.stack(event.worker);
  if (stack.empty()) return;
  const LiveJob *below = replay.find(stack.back().task, stack.back().number);
  if (below == nullptr) return;
  context_.expect(Rule::Preemption, replay.preempts(job.raised, urgency_of(*below, job.raised, job.started())),
                  event.task, event.job,
                  [&] { return "it runs on top of " + name(stack.back()) + ", which it does not outrank"; });
  context_.expect(Rule::Priority, replay.free_workers() == 0, event.task, event.job,
                  [&] { return "it runs on top of " + name(stack.back()) + ", although a worker is free"; });
}

// Full: the job that gets the worker of a preempted job must outrank that job. The check happens here and not when time
// moves on, because threads decide more than once at one instant of their clocks. What the preempted job inherits later
// does not make the preemption wrong.
void DispatchRules::check_eviction(const JobEvent &event, const LiveJob &by) {
  const auto eviction = std::find_if(evictions_.begin(), evictions_.end(),
                                     [&](const Eviction &one) { return one.worker == event.worker; });
  if (eviction == evictions_.end()) return;
  const Replay::JobRef evicted = eviction->job;
  evictions_.erase(eviction);
  const Replay &replay = context_.replay;
  const LiveJob *job = replay.find(evicted.task, evicted.number);
  if (job == nullptr) return;
  // Where levels are shared, the job may inherit from one that was looked at only after the preemption. Its own level
  // therefore decides; what it inherits counts only in the order of priorities.
  const bool outranked =
      replay.preempts(by.raised, job->own) && by.raised.key <= urgency_of(*job, by.raised, by.started()).key;
  context_.expect(Rule::Preemption, outranked, evicted.task, evicted.number, [&] {
    return "preempted by " + context_.job_name(by.task, by.number) + ", which does not outrank it";
  });
}

// The job that gets a worker must be the most urgent of those that could.
void DispatchRules::check_choice(const LiveJob &chosen, const Urgency &urgency) {
  const Replay &replay = context_.replay;
  const auto complain = [&](const Replay::JobRef &waiting) {
    complaints_.push_back(Complaint{waiting, Replay::JobRef{chosen.task, chosen.number}});
  };
  context_.expect(Rule::Priority, true, chosen.task, chosen.number, [] { return std::string(); });
  const auto &eligible = replay.eligible();
  // A resumed job (Cooperative) keeps its worker unless another outranks it by level.
  const bool goes_on = mode() == Preemption::Cooperative && chosen.state == State::Suspended;
  // A job that continues while no job may start passes the eligible ones.
  const bool none_may_start = context_.info.stepped && chosen.started();
  if (!eligible.empty() && !none_may_start) {
    const Replay::Waiter &best = *eligible.begin();
    const bool is_itself = best.task == chosen.task && best.number == chosen.number;
    const bool outranks = goes_on ? replay.preempts(best.urgency, urgency)
                                  : replay.goes_first(best.urgency, false, urgency, chosen.started());
    if (!is_itself && outranks) complain(Replay::JobRef{best.task, best.number});
  }
  for (const Replay::JobRef &ref : replay.suspended()) {
    if (ref == Replay::JobRef{chosen.task, chosen.number}) continue;
    const Urgency other = urgency_of(*replay.find(ref.task, ref.number), urgency, chosen.started());
    const bool outranks =
        goes_on ? replay.preempts(other, urgency) : replay.goes_first(other, true, urgency, chosen.started());
    if (!outranks) continue;
    complain(ref);
    break;
  }
}

void DispatchRules::deferred(const JobEvent &event) {
  const Replay &replay = context_.replay;
  const DagId dag_id = replay.dag_of(event.task);
  const Dag &dag = context_.info.workload.dags[dag_id.value];
  const bool at_bound = dag.max_active > 0 && replay.active(dag_id) >= dag.max_active;
  context_.expect(Rule::Deferral, at_bound, event.task, event.job,
                  [&] { return "it was deferred although DAG " + dag.name + " is below max_active"; });
  context_.expect(Rule::Deferral, replay.task_active(event.task) < replay.task(event.task).concurrency, event.task,
                  event.job, [] { return std::string("it was deferred although its own task keeps it from running"); });
}

void DispatchRules::preempted(const JobEvent &event, const LiveJob &job) {
  context_.expect(Rule::Preemption, mode() != Preemption::None, event.task, event.job,
                  [] { return std::string("it was preempted on a platform without preemption"); });
  if (mode() == Preemption::Full) evictions_.push_back(Eviction{Replay::JobRef{event.task, event.job}, job.worker});
  if (mode() != Preemption::Cooperative || !exact()) return;
  const Duration region = context_.replay.task(event.task).region;
  const Duration executed = job.executed + (event.time - job.on_worker_since);
  context_.expect(Rule::Preemption, region > 0 && executed % region == 0, event.task, event.job, [&] {
    return "it was preempted after " + format_duration(executed) +
           " of execution, which is not a preemption point (region " + format_duration(region) + ")";
  });
}

void DispatchRules::resumed(const JobEvent &event, const LiveJob &job) {
  context_.expect(Rule::Preemption, mode() != Preemption::None || job.state == State::Woken, event.task, event.job,
                  [] { return std::string("it was resumed on a platform without preemption"); });
  if (job.state != State::Suspended && job.state != State::Woken) return;
  if (job.state == State::Woken) check_place(event, job);
  check_eviction(event, job);
  check_choice(job, job.raised);
}

void DispatchRules::ended(const JobEvent &event, const LiveJob &job) {
  // Real preemption: the operating system may run a job that the scheduler counts as preempted.
  const bool may_end_suspended = context_.info.driver != trace::Driver::Simulator && mode() == Preemption::Full;
  context_.expect(Rule::Life, job.state != State::Suspended || may_end_suspended, event.task, event.job,
                  [] { return std::string("it ended while it was preempted"); });
  const bool may_end_waiting = context_.info.driver != trace::Driver::Simulator;
  context_.expect(Rule::Life, (!job.is_waiting() && job.state != State::Woken) || may_end_waiting, event.task,
                  event.job, [] { return std::string("it ended without a worker, while it waited"); });
  context_.expect(Rule::Life, event.value >= job.release && event.value <= event.time, event.task, event.job, [&] {
    return "it ended at " + format_duration(event.value) + ", before the least time that it needs";
  });
  check_order_of_ends(event);
  if (context_.info.driver != trace::Driver::Simulator || job.state != State::Running) return;
  const Task &task = context_.replay.task(event.task);
  const Duration demand = context_.demand_of(event.task, event.job);
  const bool cut_off = event.kind == JobEventKind::Aborted && event.reason == Reason::Budget;
  if (event.kind == JobEventKind::Aborted && !cut_off) return;
  context_.expect(Rule::Execution,
                  !cut_off || (task.on_budget == OnBudget::Abort && task.budget > 0 && demand > task.budget),
                  event.task, event.job, [&] { return "it was cut off although it needs " + format_duration(demand); });
  const Duration expected = cut_off ? task.budget : demand;
  const Duration executed = job.executed + (event.value - job.on_worker_since);
  context_.expect(Rule::Execution, exact() ? executed == expected : executed >= expected, event.task, event.job, [&] {
    return "it executed for " + format_duration(executed) + "; expected " + format_duration(expected);
  });
}

// In virtual time, jobs that end at one instant end in the static order of tasks, those of one task in release order.
void DispatchRules::check_order_of_ends(const JobEvent &event) {
  if (context_.info.driver != trace::Driver::Simulator) return;
  const Ended ended{event.time, places_[event.task.value], Replay::JobRef{event.task, event.job}};
  if (last_ended_ && last_ended_->time == ended.time) {
    const auto order = [](const Ended &one) { return std::pair(one.place, one.job.number); };
    context_.expect(Rule::Precedence, order(*last_ended_) < order(ended), event.task, event.job, [&] {
      return "it ended at the same instant as " + name(last_ended_->job) + ", but was reported after it";
    });
  }
  last_ended_ = ended;
}

void DispatchRules::end_of_instant() {
  for (const Complaint &complaint : complaints_) {
    const LiveJob *waiting = context_.replay.find(complaint.waiting.task, complaint.waiting.number);
    const bool void_now = waiting != nullptr && waiting->state == State::Running;
    context_.expect(Rule::Priority, void_now, complaint.waiting.task, complaint.waiting.number,
                    [&] { return "it was eligible and more urgent, but " + name(complaint.chosen) + " was chosen"; });
  }
  complaints_.clear();
  for (const Eviction &eviction : evictions_) {
    context_.expect(Rule::Preemption, false, eviction.job.task, eviction.job.number,
                    [] { return std::string("it was preempted, but no job took its worker"); });
  }
  evictions_.clear();
  check_free_workers();
  if (mode() == Preemption::Full) check_running();
}

// A simulated job that still runs when the run ends must have work left.
void DispatchRules::end_of_trace() {
  if (!exact()) return;
  for (std::uint32_t w = 0; w < context_.replay.worker_count(); ++w) {
    const LiveJob *job = context_.replay.running(w);
    if (job == nullptr) continue;
    const Task &task = context_.replay.task(job->task);
    Duration demand = context_.demand_of(job->task, job->number);
    if (task.budget > 0 && task.on_budget == OnBudget::Abort) demand = std::min(demand, task.budget);
    const Duration executed = job->executed + (context_.info.end - job->on_worker_since);
    context_.expect(Rule::Execution, executed < demand, job->task, job->number,
                    [&] { return "it never ended, although it needs only " + format_duration(demand); });
  }
}

void DispatchRules::check_free_workers() {
  const Replay &replay = context_.replay;
  if (mode() == Preemption::Cooperative) {
    for (std::uint32_t w = 0; w < replay.worker_count(); ++w) {
      const auto stack = replay.stack(w);
      if (stack.empty()) continue;
      context_.expect(Rule::WorkConservation, replay.running(w) != nullptr, stack.back().task, stack.back().number,
                      [&] { return "it is suspended, and nothing runs on its worker"; });
    }
  }
  if (replay.free_workers() == 0) return;
  const auto &eligible = replay.eligible();
  const Replay::Waiter waiter = eligible.empty() ? Replay::Waiter{} : *eligible.begin();
  context_.expect(Rule::WorkConservation, eligible.empty() || context_.info.stepped, waiter.task, waiter.number,
                  [] { return std::string("it is eligible, and a worker is free"); });
  const auto suspended = replay.suspended();
  const Replay::JobRef preempted_job = suspended.empty() ? Replay::JobRef{} : suspended.front();
  context_.expect(Rule::WorkConservation, suspended.empty(), preempted_job.task, preempted_job.number,
                  [] { return std::string("it has started and needs a worker, and a worker is free"); });
  const auto &owed = replay.owed_deferral();
  const TaskId undeferred = owed.empty() ? TaskId() : *owed.begin();
  // A job that waits for a thread is not looked at until there is one. Waiting jobs hold threads, but no workers.
  const bool is_looked_at = !context_.info.stepped && !replay.at_thread_limit();
  context_.expect(Rule::Deferral, owed.empty() || !is_looked_at, undeferred, 0, [] {
    return std::string(
        "it was not deferred, although it is the first ready job and only max_active keeps it from a free worker");
  });
}

// Full: no waiting job outranks a running one.
void DispatchRules::check_running() {
  const Replay &replay = context_.replay;
  const LiveJob *least = nullptr;
  for (std::uint32_t w = 0; w < replay.worker_count(); ++w) {
    const LiveJob *job = replay.running(w);
    if (job != nullptr && (least == nullptr || least->raised < job->raised)) least = job;
  }
  if (least == nullptr) return;
  const auto judge = [&](const Urgency &urgency, TaskId task, std::uint32_t number) {
    context_.expect(Rule::Priority, !replay.preempts(urgency, least->raised), task, number, [&] {
      return "it waits while " + context_.job_name(least->task, least->number) + ", which is less urgent, runs";
    });
  };
  const auto &eligible = replay.eligible();
  if (!eligible.empty() && !context_.info.stepped)
    judge(eligible.begin()->urgency, eligible.begin()->task, eligible.begin()->number);
  // A preempted job inherits only from jobs that are looked at: those that could themselves preempt.
  for (const Replay::JobRef &ref : replay.suspended()) {
    const LiveJob *job = replay.find(ref.task, ref.number);
    judge(urgency_of(*job, least->raised, true), ref.task, ref.number);
  }
}

// Returns the urgency with what a started job inherits from those that wait for its group. In a stepped run those may
// not have been looked at, and only its own urgency is certain.
Urgency DispatchRules::urgency_of(const LiveJob &job) const {
  return context_.info.stepped ? job.own : context_.replay.inherited(job);
}

// The same at the time when a job of urgency `looked_at` is looked at, which has `started` or not.
Urgency DispatchRules::urgency_of(const LiveJob &job, const Urgency &looked_at, bool started) const {
  return context_.info.stepped ? job.own : context_.replay.inherited(job, looked_at, started);
}

}  // namespace redag::metrics
