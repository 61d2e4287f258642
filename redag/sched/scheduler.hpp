// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The scheduler's interface: events in, decisions out. An implementation is a value without thread, clock or I/O. After
// construction it allocates only for reconfiguration. Not thread-safe: the driver serialises the calls.
//
// A driver reports what happened (release, complete, exceed, preemption_point), any number of events at one instant.
// Then it asks for decisions with dispatch(), which considers all events of that instant together.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>

#include "redag/base/check.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::sched {

/// A limit that a job can use up (docs/model.md, "Budgets" and "Criticality").
enum class Limit : std::uint8_t {
  Budget,   // Task::budget: the action of `on_budget` happens
  WcetLow,  // Task::wcet_low: HI mode begins
};

enum class Outcome : std::uint8_t {
  Finished,
  Threw,
  BudgetExceeded,
  NoData,  // the job found nothing to do: its message was overwritten or its timer cancelled
};

/// Why a job with this outcome is aborted.
[[nodiscard]] constexpr Reason reason_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::Threw: return Reason::Exception;
    case Outcome::BudgetExceeded: return Reason::Budget;
    case Outcome::NoData: return Reason::NoData;
    case Outcome::Finished: break;
  }
  return Reason::None;
}

/// A set of kinds of events.
class EventKinds {
 public:
  constexpr EventKinds(std::initializer_list<JobEventKind> kinds) {
    for (const JobEventKind kind : kinds) bits_ |= bit(kind);
  }
  [[nodiscard]] static constexpr EventKinds all() { return EventKinds(~0U); }
  [[nodiscard]] constexpr bool contains(JobEventKind kind) const { return (bits_ & bit(kind)) != 0; }

 private:
  constexpr explicit EventKinds(std::uint32_t bits) : bits_(bits) {}
  [[nodiscard]] static constexpr std::uint32_t bit(JobEventKind kind) { return 1U << static_cast<unsigned>(kind); }

  std::uint32_t bits_ = 0;
};

/// Up to this many releases between two calls of dispatch() never allocate, for any tasks.
inline constexpr std::size_t kMostReleasesAtOnce = 256;

/// For dispatch(): start as many jobs as there are places.
inline constexpr std::uint32_t kNoLimit = 0xffffffff;

/// The level of a task that is gone.
inline constexpr std::uint32_t kNoLevel = 0xffffffff;

enum class DispatchKind : std::uint8_t {
  Start,   // the job begins on `worker`
  Resume,  // the job, suspended until now, continues on `worker`
  Level,   // the started job keeps its state, running or suspended, and has a new level
  Serve,   // the device that the job asked begins to serve it; it has no worker, and `level` is not set
};

/// One decision, effective now. If one step has several for a job, the last one holds.
struct Dispatch {
  JobSlot job;
  TaskId task;
  std::uint32_t number = 0;  // number of the job within its task
  Time release = 0;          // nominal
  Time origin = 0;           // the earliest release whose data the job carries
  WorkerId worker;
  JobSlot over;  // the job that loses the worker (Full) or is suspended under this one (Cooperative); invalid: none
  DispatchKind kind = DispatchKind::Start;
  std::uint32_t level = 0;  // its priority level, 0 the most urgent; includes inherited priority
};

/// The result of a dispatch. Valid until the next call.
struct Step {
  std::span<const Dispatch> dispatches;
  std::span<const JobEvent> events;  // everything since the last dispatch(), in decision order
};

class Scheduler {
 public:
  virtual ~Scheduler() = default;

  /// Reports that the period of timer task `task` expired at `nominal`, seen at `now`. Ignores removed tasks. `origin`:
  /// the time from which the job's data is, if the task has no predecessors here and the driver knows it to be older
  /// than the release.
  virtual void release(TaskId task, Time nominal, Time now, Time origin) = 0;
  void release(TaskId task, Time nominal, Time now) { release(task, nominal, now, nominal); }

  /// Reports that a message for data task `task`, which add_task() added, came at `at`, with data from `origin`. It is
  /// one more predecessor: the job is released when all of them have completed. `sender`: the task whose job is sending
  /// it; its earlier end does not count. Not valid: nobody knows.
  virtual void receive(TaskId task, TaskId sender, Time at, Time now, Time origin);

  /// Reports a release of timer task `task` that is skipped at once for `reason`: a period that the timer missed, or a
  /// message that the middleware overwrote. The task's other jobs are not affected. If the scheduler would refuse the
  /// release anyway (budget, HI mode), it records that reason instead.
  virtual void miss(TaskId task, Time nominal, Time now, Reason reason) = 0;

  /// Reports that a dispatched job ended at `now` with `outcome`. Releases data tasks whose predecessors are now
  /// complete.
  virtual void complete(JobSlot job, Time now, Outcome outcome) = 0;

  /// Reports that a running job reached a preemption point (Preemption::Cooperative). The next dispatch() can suspend
  /// it. If that dispatch puts no job over it, the job continues.
  virtual void preemption_point(JobSlot job, Time now) = 0;

  /// Reports that a started job has used `limit` and continues, at most once for each job and limit. For a job that is
  /// cut off at its budget, call complete() instead.
  virtual void exceed(JobSlot job, Limit limit, Time now) = 0;
  /// Returns true in HI mode: DAGs of lower criticality are degraded.
  [[nodiscard]] virtual bool high_mode() const = 0;

  /// Reports that a running job left its worker to wait for `device`, or for something else if that is invalid. A
  /// dispatch() tells when the device begins to serve it. With full preemption, it may count as preempted.
  virtual void wait(JobSlot job, DeviceId device, Time now);
  /// Reports that the wait of a job is over: its device has served it, or what it waited for has happened. It then
  /// waits for a worker, in its old place in the order of jobs. A job that waits can also end, by complete().
  virtual void wake(JobSlot job, Time now);

  /// Takes the decisions. A second call without a new event yields nothing. At most `most` jobs are started. Once that
  /// many are, dispatch() ignores the other unstarted jobs, and started ones continue as if those did not exist.
  virtual Step dispatch(Time now, std::uint32_t most = kNoLimit) = 0;

  /// As complete(), then dispatch(): for a thread that has ended a job and needs its next one.
  virtual Step finish(JobSlot job, Time now, Outcome outcome, std::uint32_t most = kNoLimit) {
    complete(job, now, outcome);
    return dispatch(now, most);
  }

  /// From now on, steps have only events of these kinds. By default they have all. Decisions do not depend on it.
  virtual void record_only(EventKinds kinds) = 0;

  /// Cooperative: returns true if dispatch() could put a job over `job` at a preemption point now. May return true
  /// although a bound or a group keeps the more urgent job waiting; never false wrongly. Other modes: returns false.
  [[nodiscard]] virtual bool outranked(JobSlot job) const = 0;

  // Reconfiguration. All of it allocates, and assigns new priorities where tasks or timings change. New ids follow the
  // existing ones, unless Config::reuse_ids finds free ones. Periods and deadlines must be set (inherit_periods).

  /// Adds a DAG, which may have no tasks yet.
  virtual DagId add_dag(const Dag &dag, Time now) = 0;
  /// Removes a DAG: skips jobs that have not started. Started jobs end as usual.
  virtual void remove_dag(DagId dag, Time now) = 0;
  /// Adds a task without predecessors to a DAG. A timer task is released from outside, a data task by its messages.
  /// `rank` is its topological rank in the DAG: ties of the policy are broken by DAG, rank and TaskId. `more`: the next
  /// call adds another one. Priorities are assigned with the last one, since that takes time for all tasks.
  virtual TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now, bool more) = 0;
  TaskId add_task(DagId dag, std::uint32_t rank, const Task &task, Time now) {
    return add_task(dag, rank, task, now, false);
  }
  /// Replaces the predecessors of a task that add_task() added by others of its DAG. No edge of it is aligned.
  virtual void set_predecessors(TaskId task, std::span<const TaskId> predecessors, Time now);
  /// As remove_dag(), for one task. Its successors get no more data from it.
  virtual void remove_task(TaskId task, Time now) = 0;
  /// Sets a new period and deadline for jobs released from now on. The order of tasks changes at once. Successors keep
  /// theirs.
  virtual void set_timing(TaskId task, Duration period, Duration deadline, Time now) = 0;
  /// Ends the run: skips jobs that have not started (Removed) and releases nothing any more. Removes no task.
  virtual void close(Time now) = 0;

  /// The DAG's tasks, first those it was added with, in its order. Includes removed tasks until their ids are used
  /// again. Valid until the next reconfiguration.
  [[nodiscard]] virtual std::span<const TaskId> tasks_of(DagId dag) const = 0;
  /// The devices with which it was built, by DeviceId.
  [[nodiscard]] virtual std::span<const Device> devices() const { return {}; }
  /// Ids in use are smaller than these numbers.
  [[nodiscard]] virtual std::size_t task_slots() const = 0;
  [[nodiscard]] virtual std::size_t dag_slots() const = 0;

  [[nodiscard]] virtual Accounting accounting(TaskId task) const = 0;
  /// Number of ready, unstarted jobs. Other unstarted jobs wait for predecessors.
  [[nodiscard]] virtual std::uint32_t ready(TaskId task) const = 0;
  /// The level of the task's jobs that have inherited nothing and are not demoted; kNoLevel: it is removed and has no
  /// job left, or levels mean nothing to this scheduler.
  [[nodiscard]] virtual std::uint32_t level(TaskId /*task*/) const { return kNoLevel; }
  /// How often a job found a worker and only Config::max_started kept it from starting.
  [[nodiscard]] virtual std::uint64_t thread_waits() const { return 0; }
};

inline void Scheduler::receive(TaskId /*task*/, TaskId /*sender*/, Time /*at*/, Time /*now*/, Time /*origin*/) {
  REDAG_CHECK(false, "a message, which this scheduler does not know");
}

inline void Scheduler::set_predecessors(TaskId /*task*/, std::span<const TaskId> /*predecessors*/, Time /*now*/) {
  REDAG_CHECK(false, "new predecessors, which this scheduler does not know");
}

inline void Scheduler::wait(JobSlot /*job*/, DeviceId /*device*/, Time /*now*/) {
  REDAG_CHECK(false, "a job waits, which this scheduler does not know");
}

inline void Scheduler::wake(JobSlot /*job*/, Time /*now*/) {
  REDAG_CHECK(false, "a job wakes, which this scheduler does not know");
}

}  // namespace redag::sched
