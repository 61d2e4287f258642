// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The input of the bounds: a workload on a platform, compiled once into numbers. Execution times include the platform's
// overheads. Priorities are those of sched::assign_priorities. Tasks of one rate that edges join form one unit. Plain
// values, immutable once compiled; safe to share among threads.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/derived/overheads.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::analysis {

/// The platform as it really runs, with `auto` and `os` resolved. Overheads are those of sim::Overheads.
struct AnalysisPlatform {
  std::uint32_t workers = 1;
  sched::Preemption preemption = sched::Preemption::Full;
  std::uint32_t levels = 0;       // distinct priority levels; 0: as many as needed (sched::Config::levels)
  std::uint32_t max_started = 0;  // jobs started and unfinished at once; 0: no bound (sched::Config::max_started)
  Duration release_overhead = 0;  // of each job, before its body
  Duration dispatch_overhead = 0;
  Duration preempt_overhead = 0;  // of each resumption; charged to the job that preempted, on several workers to all
  // Further costs of a real machine, set by charge().
  Duration lateness = 0;        // the most by which a timer's release is seen late
  Duration timer_overhead = 0;  // processor time that the release timer takes from some job, per release
  Loss stall;                   // of each processor

  friend bool operator==(const AnalysisPlatform &, const AnalysisPlatform &) = default;
};

/// Returns `platform` with the measured overheads of a machine (docs/calibration.md, "What is charged").
[[nodiscard]] AnalysisPlatform charge(AnalysisPlatform platform, const Overheads &overheads);

/// Returns the scheduler's configuration whose schedules of `workload` the bounds on `platform` hold for.
[[nodiscard]] sched::Config config_of(const AnalysisPlatform &platform, const Workload &workload);

/// The platform that a scheduler was configured for, without overheads.
[[nodiscard]] AnalysisPlatform platform_of(const sched::Config &config);

/// The platform on which the simulator runs the workload: `os` and `auto` mean full preemption; no overheads.
[[nodiscard]] AnalysisPlatform platform_of(const Workload &workload);

/// Returns the platform of one part of the workload, from that of the whole.
[[nodiscard]] AnalysisPlatform platform_of(AnalysisPlatform whole, const ClusterPart &part);

/// A run as the bounds see it: the workload with the policy and the ties of its scheduler, and its platform.
struct ExecutedRun {
  Workload workload;
  AnalysisPlatform platform;
};

/// `overheads` is the text that a run records: of a machine, as to_string() writes them, or "release 2us, dispatch 1us,
/// preempt 0" of a simulation; empty: none. Error: any other text.
[[nodiscard]] Result<ExecutedRun> as_executed(Workload workload, const sched::Config &config,
                                              std::string_view overheads);

inline constexpr std::uint32_t kNoGroup = 0xffffffff;

/// What a job of one task asks of one device.
struct DeviceUse {
  std::uint32_t requests = 0;
  Duration service = 0;  // of all requests together
  Duration longest = 0;  // of one request
  Duration blocked = 0;  // less urgent service before the requests, on one worker (waiting.hpp)

  friend bool operator==(const DeviceUse &, const DeviceUse &) = default;
};

/// One per TaskId.
struct CompiledTask {
  std::string name;  // "dag.task"
  DagId dag;
  std::uint32_t unit = 0;
  Duration wcet = 0;      // C with overheads and waits
  Duration wcet_low = 0;  // C(LO) with overheads, while wcet is C(HI); equal to wcet if the task has no `wcet_low`
  Duration bcet = 0;      // with overheads, > 0; only explorations of tests read it: bounds hold for shorter executions
  Duration overhead = 0;  // the part of `wcet` that is overhead
  Duration waits = 0;     // the part of `wcet` in which the job needs no worker: all of `devices`, and `elsewhere`
  std::vector<DeviceUse> devices;   // by DeviceId; empty if no task waits
  Duration elsewhere = 0;           // waits without a device
  std::uint32_t wake_ups = 0;       // the number of its waits
  std::vector<Duration> stretches;  // execution before, between and after its waits; empty if it does not wait
  Duration period = 0;              // T, least distance of two nominal releases of the unit
  Duration offset = 0;    // a timer's own; a data task's is that of its grid (see Unit). Bounds of units without rate
                          // edges hold for all offsets
  Duration deadline = 0;  // D, from the task's own release
  Duration jitter = 0;    // J
  Duration limit = 0;     // response up to which no job of the task is skipped (T, or T * queue_depth)
  Duration region = 0;    // longest stretch without a preemption point, overheads included; 0 with full preemption
  Duration last_region = 0;        // stretch after the last preemption point of a job of length wcet; 0 likewise
  std::uint32_t rank = 0;          // place in the order of tasks; 0 is the most urgent
  std::uint32_t tier = 0;          // tasks of one tier take turns: any of them can go first
  std::uint32_t level = 0;         // tasks of one level do not preempt each other
  std::uint32_t group = kNoGroup;  // only groups that two or more tasks share
  bool data = false;               // released by its predecessors' completion
  std::uint32_t at_once = 1;       // the most of its jobs that are started and unfinished
  Duration replaced = 0;           // from a release to the next one that is not itself refused, jitter aside
  bool can_sink = false;           // a job of it can be demoted below all others
  bool can_lose = false;           // a job of it can be skipped or cut off although it would end in time
  std::uint32_t clock = 0;         // what its grid counts from; see is_released_with()
  std::string refusal;             // why no bound covers it; empty: nothing speaks against it
  bool has_gaps = false;           // its grid is that of events: the points are T apart, or any time more
  std::vector<std::uint32_t> predecessors;  // TaskIds
  std::vector<std::uint32_t> successors;    // TaskIds
};

/// True if job k of one is always released with job k of the other: both have one grid. Grids of different clocks have
/// no known phase: the timers of two executors, what comes from outside, and a data task that joins such sources.
[[nodiscard]] constexpr bool is_released_with(const CompiledTask &a, const CompiledTask &b) {
  return a.clock == b.clock && a.period == b.period && a.offset == b.offset;
}

/// A unit is what is released as a whole: a task without edges, or tasks of one rate that edges join. A DAG with edges
/// and one grid is one unit. Otherwise each connected part of a DAG is one, cut at *rate edges*: those into a task with
/// a predecessor on another grid. The response time of a unit runs from its nominal release to the finish
/// of its last task. The nominal release of a unit behind rate edges is the point of its grid, `offset` + k `period`.
/// That grid is the timer's own, or that of the predecessor with the largest period (rate_edges.hpp). A data task that
/// joins several clocks has a grid of its own, whose points are at least a period apart.
struct Unit {
  DagId dag;
  std::vector<std::uint32_t> tasks;   // TaskIds in topological order
  std::vector<std::uint32_t> awaits;  // TaskIds of other units whose data its first task waits for: rate edges
  Duration period = 0;
  Duration offset = 0;
  Duration deadline = 0;         // the least of its tasks' and the DAG's end-to-end one; if it is met, all of these are
  Duration jitter = 0;           // the largest of its tasks
  Duration limit = 0;            // the least of its tasks; with edges never above the period
  Duration volume = 0;           // sum of wcet
  Duration length = 0;           // longest path
  std::uint32_t first_rank = 0;  // the most urgent of its tasks; last_rank: the least urgent
  std::uint32_t last_rank = 0;
  bool has_edges = false;
  bool keeps_grid =
      false;           // a timer that waits for none: job k is ready at `offset` + k `period`, or up to `jitter` later
  Duration phase = 0;  // from the begin of a busy period to its first release that counts, as late as that is seen

  /// How long before a busy period the first release that counts in it can be; negative: after it has begun.
  [[nodiscard]] Duration ahead() const { return jitter - phase; }
};

struct CompiledDag {
  std::string name;
  std::vector<std::uint32_t> units;
  std::vector<std::uint32_t> tasks;  // TaskIds
  std::uint32_t max_active = 0;      // 0: no bound; otherwise below the number of its tasks
  Duration deadline = 0;             // end to end; 0: none
  bool high = false;                 // never degraded: of high criticality, or no job of its executor begins HI mode
};

struct TaskSet {
  AnalysisPlatform platform;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;
  std::vector<CompiledTask> tasks;
  std::vector<Unit> units;
  std::vector<CompiledDag> dags;
  std::vector<std::uint32_t> by_rank;              // TaskIds, most urgent first
  std::vector<std::vector<std::uint32_t>> groups;  // TaskIds of each group
  std::vector<Device> devices;                     // of the platform
  bool several_executors = false;                  // Platform::several_executors
  double utilization = 0;                          // processor time / period, overheads included; only to be shown
  /// Features that no bound covers, such as a budget below the wcet or a queue that is too small. Every method then
  /// answers NotApplicable with this reason.
  std::string not_analysable;
  /// not_analysable is a reason for all tasks, not CompiledTask::refusal of some, nor waits.
  bool is_refused_whole = false;
  /// Times are too long for sums, or no processor time is left: no method applies at all.
  bool is_beyond_numbers = false;
  /// There are fewer threads than tasks, but enough if every response is within its period (jobs_in_progress.hpp).
  bool threads_suffice_if_bounded = false;
  /// Some wcet_low is below its wcet: there is a HI mode, and not_analysable has no other reason. Methods that know
  /// modes (Method::knows_modes) apply.
  bool has_modes = false;
  /// With has_modes: several executors start jobs, and HI mode of one does not concern the others.
  bool has_separate_modes = false;
  /// Jobs wait without a worker, and not_analysable has no other reason. CompiledTask::wcet counts waits as execution,
  /// and methods that are sound then, or that look at the waits themselves (Method::knows_waits), apply.
  bool has_waits = false;

  /// Time in which the machine can leave all jobs without a processor during any response time, besides the share that
  /// lengthens executions. The timers' jitter contains it, because a late and a longer window are equivalent
  /// (docs/analysis.md, "Stalls"). Responses from another point than the nominal release have to add it.
  Duration frozen = 0;
  /// More such time, in jitter as well, for a method that bounds responses beyond the period: what was unfinished makes
  /// data tasks preempt later.
  Duration frozen_behind = 0;

  /// The platform's mode; None if it is cooperative and no task has a preemption point.
  sched::Preemption mode = sched::Preemption::Full;

  /// True if no method applies.
  [[nodiscard]] bool is_beyond_all() const { return !not_analysable.empty() && !has_modes && !has_waits; }
  [[nodiscard]] bool has_edges() const;       // some unit has edges
  [[nodiscard]] bool has_rate_edges() const;  // some unit awaits data of another
};

/// refuse_tasks() and refuse_waits() set what not_analysable and has_waits say of the tasks, unless it has a reason.
void refuse_tasks(TaskSet &task_set);
void refuse_waits(TaskSet &task_set);

/// make_unit() measures these tasks of the DAG, which stand in topological order, as one unit.
[[nodiscard]] Unit make_unit(const TaskSet &task_set, DagId dag, std::vector<std::uint32_t> tasks);

/// Compiles a workload. Fails where validate() finds an error (set the periods of data tasks first: inherit_periods()),
/// and for a platform with clusters, without workers or with negative overheads. O(n log n + edges).
[[nodiscard]] Result<TaskSet> compile(const Workload &workload, const AnalysisPlatform &platform);

}  // namespace redag::analysis
