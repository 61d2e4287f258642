// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The scheduler's interface: events in, decisions out. An implementation is a value: no thread, no clock, no I/O, and
// after construction no allocation (except in reconfiguration). Not thread-safe: the driver serialises the calls.
//
// A driver reports what happened (release, complete, exceed, preemption_point), any number at one instant, and then
// asks for the decisions with dispatch(). Releases and completions of one instant are so decided together.
#pragma once

#include <cstdint>
#include <span>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::sched {

/// What a job can use up (docs/model.md, "Budgets" and "Criticality").
enum class Limit : std::uint8_t {
  Budget,   // Task::budget: `on_budget` happens
  WcetLow,  // Task::wcet_low: HI mode begins
};

enum class Outcome : std::uint8_t {
  Finished,
  Threw,
  BudgetExceeded,
  NoData,  // found nothing to do: its message was overwritten, its timer cancelled
};

/// Between two calls of dispatch(), so many releases never allocate, whichever tasks they are of.
inline constexpr std::size_t kMostReleasesAtOnce = 256;

/// Of dispatch(): as many jobs as there are places.
inline constexpr std::uint32_t kNoLimit = 0xffffffff;

enum class DispatchKind : std::uint8_t {
  Start,   // the job begins on `worker`
  Resume,  // the job, suspended until now, goes on, on `worker`
  Level,   // the started job keeps its state, running or suspended; only its level changed
};

/// One decision, effective now. Of several for one job in a step, the last one holds.
struct Dispatch {
  JobSlot job;
  TaskId task;
  std::uint32_t number = 0;  // of the job within its task
  Time release = 0;          // nominal
  WorkerId worker;
  JobSlot over;  // the job that loses the worker (Full), or is suspended under this one (Cooperative); or none
  DispatchKind kind = DispatchKind::Start;
  bool inherits = false;    // its level is that of a more urgent job, which waits for it
  std::uint32_t level = 0;  // its priority level, 0 the most urgent; inherited priority included
};

/// Valid until the next call.
struct Step {
  std::span<const Dispatch> dispatches;
  std::span<const JobEvent> events;  // everything since the last dispatch(), in decision order
};

class Scheduler {
 public:
  virtual ~Scheduler() = default;

  /// The period of timer task `task` expired at `nominal`; it is `now`. A release of a removed task is ignored.
  virtual void release(TaskId task, Time nominal, Time now) = 0;

  /// A release of timer task `task` that is skipped at once, as `reason`: a period that the timer missed, a message
  /// that the middleware overwrote. Nothing else happens to the task's jobs. One that would not be taken anyway (a
  /// budget, HI mode) is skipped as that.
  virtual void miss(TaskId task, Time nominal, Time now, Reason reason) = 0;

  /// A dispatched job ended at `now` as `outcome`. Data tasks whose predecessors are now complete are released.
  virtual void complete(JobSlot job, Time now, Outcome outcome) = 0;

  /// A running job (Preemption::Cooperative) can be suspended until the next dispatch(). If that dispatch puts no job
  /// over it, it simply goes on.
  virtual void preemption_point(JobSlot job, Time now) = 0;

  /// A started job has used `limit` and goes on: for each job and limit at most once. One that is cut off at its budget
  /// is complete() instead.
  virtual void exceed(JobSlot job, Limit limit, Time now) = 0;
  /// Are DAGs of lower criticality degraded now?
  [[nodiscard]] virtual bool high_mode() const = 0;

  /// Decides. Calling it again without a new event yields nothing. Of the jobs that have not started, at most `most` do
  /// now; once that many have, the others are not looked at, and started ones go on as if those were not there.
  virtual Step dispatch(Time now, std::uint32_t most = kNoLimit) = 0;

  /// Cooperative: could dispatch() put a job over `job` if that were at a preemption point now? May say yes in vain (a
  /// bound or a group can keep the more urgent job waiting), never no. In the other modes: no.
  [[nodiscard]] virtual bool outranked(JobSlot job) const = 0;

  // Reconfiguration; all of it allocates, and assigns priorities anew where tasks or timings change. New ids follow the
  // existing ones, unless Config::reuse_ids finds free ones. Periods and deadlines must be set (inherit_periods).

  /// A DAG may have no tasks yet.
  virtual DagId add_dag(const Dag &dag, Time now) = 0;
  /// Skips what has not started; what has started ends as usual.
  virtual void remove_dag(DagId dag, Time now) = 0;
  /// Adds a timer task without predecessors to a DAG, to be released from outside. `rank` is its topological rank
  /// there, for the total order: ties of the policy are broken by DAG, rank, TaskId.
  virtual TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now) = 0;
  /// As remove_dag(), for one task. Its successors get no data from it any more.
  virtual void remove_task(TaskId task, Time now) = 0;
  /// Another period and deadline, for jobs released from now on; the order changes at once. Successors keep theirs.
  virtual void set_timing(TaskId task, Duration period, Duration deadline, Time now) = 0;
  /// The run ends: what has not started is skipped (Removed), and nothing is released any more. Nothing is removed.
  virtual void close(Time now) = 0;

  /// The DAG's tasks, removed ones as long as their ids are theirs; first those it was added with, in its order. Valid
  /// until the next reconfiguration.
  [[nodiscard]] virtual std::span<const TaskId> tasks_of(DagId dag) const = 0;
  [[nodiscard]] virtual Criticality criticality(DagId dag) const = 0;
  /// Ids in use are smaller than these.
  [[nodiscard]] virtual std::size_t task_slots() const = 0;
  [[nodiscard]] virtual std::size_t dag_slots() const = 0;

  [[nodiscard]] virtual Accounting accounting(TaskId task) const = 0;
  /// Jobs that are ready and have not started; of the others in flight that have not, predecessors are incomplete.
  [[nodiscard]] virtual std::uint32_t ready(TaskId task) const = 0;
  /// How often a job found a worker and only Config::max_started kept it from starting.
  [[nodiscard]] virtual std::uint64_t thread_waits() const { return 0; }
};

}  // namespace redag::sched
