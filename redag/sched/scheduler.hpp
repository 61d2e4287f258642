// The scheduler's interface: events in, decisions out. An implementation is a value: no thread, no clock, no I/O, and
// after construction no allocation (except in add_dag/remove_dag). Not thread-safe: the driver serialises the calls.
//
// A driver reports what happened (release, complete, preemption_point), any number at one instant, and then asks for
// the decisions with dispatch(). Releases and completions of one instant are so decided together.
#pragma once

#include <cstdint>
#include <span>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag::sched {

/// What the platform can do to a running job.
enum class Preemption : std::uint8_t {
  None,         // a job keeps its worker until it ends
  Cooperative,  // at its own preemption points a job lets a higher-priority one run on top of it, on the same worker
  Full,         // a job can be preempted at any time and resumed on any worker
};

struct Config {
  std::uint32_t workers = 1;  // m
  Preemption preemption = Preemption::None;
  PolicyKind policy = PolicyKind::RateMonotonic;
  // Full preemption on an operating system: number of distinct priority levels it has for us (0: as many as tasks).
  // Where tasks outnumber levels, tasks that share a level do not preempt each other.
  std::uint32_t levels = 0;
  // Full preemption on threads: jobs that can be started and unfinished at once (0: no bound).
  std::uint32_t max_started = 0;
};

enum class Outcome : std::uint8_t { Finished, Threw, BudgetExceeded };

/// One decision: run `job` on `worker` from now. With `resume`, for a job that runs there already: only its level
/// changed.
struct Dispatch {
  JobSlot job;
  TaskId task;
  std::uint32_t number = 0;  // of the job within its task
  WorkerId worker;
  JobSlot over;         // the job that loses the worker (Full), or is suspended under this one (Cooperative); or none
  bool resume = false;  // the job had started before
  std::uint32_t level = 0;  // priority level at which it runs, 0 the most urgent; inherited priority included
};

/// Valid until the next call.
struct Step {
  std::span<const Dispatch> dispatches;
  std::span<const JobEvent> events;  // everything since the last dispatch(), in decision order
};

/// Jobs of one task: released = finished + skipped + aborted + in flight.
struct Accounting {
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  std::uint64_t skipped = 0;
  std::uint64_t aborted = 0;
  std::uint64_t deferred = 0;

  [[nodiscard]] std::uint64_t in_flight() const { return released - finished - skipped - aborted; }
  friend bool operator==(const Accounting &, const Accounting &) = default;
};

class Scheduler {
 public:
  virtual ~Scheduler() = default;

  /// The period of timer task `task` expired at `nominal`; it is `now`. A release of a removed task is ignored.
  virtual void release(TaskId task, Time nominal, Time now) = 0;

  /// A dispatched job ended at `now` as `outcome`. Data tasks whose predecessors are now complete are released.
  virtual void complete(JobSlot job, Time now, Outcome outcome) = 0;

  /// A running job (Preemption::Cooperative) can be suspended until the next dispatch(). If that dispatch puts no job
  /// over it, it simply goes on.
  virtual void preemption_point(JobSlot job, Time now) = 0;

  /// Decides. Calling it again without a new event yields nothing.
  virtual Step dispatch(Time now) = 0;

  /// Cooperative: could dispatch() put a job over `job` if that were at a preemption point now? May say yes in vain (a
  /// bound or a group can keep the more urgent job waiting), never no. In the other modes: no.
  [[nodiscard]] virtual bool outranked(JobSlot job) const = 0;

  /// Reconfiguration; both allocate. New TaskIds follow the existing ones and are never reused. Periods and deadlines
  /// must be set (inherit_periods). remove_dag skips what has not started; what has started ends as usual.
  virtual DagId add_dag(const Dag &dag, Time now) = 0;
  virtual void remove_dag(DagId dag, Time now) = 0;

  [[nodiscard]] virtual Accounting accounting(TaskId task) const = 0;
};

}  // namespace redag::sched
