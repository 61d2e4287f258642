// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a scheduler in virtual time. Discrete events in integer nanoseconds; the same workload, options and seed give
// the same events, bit for bit, on every machine. Works with any sched::Scheduler. Single-threaded.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "redag/derived/overheads.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::sim {

/// Processor time that the platform takes, charged to the job that causes it. Default: none.
struct Overheads {
  Duration release = 0;   // handling a release: added to the released job's demand
  Duration dispatch = 0;  // starting a job: spent on its worker before the body
  Duration preempt = 0;   // each resumption after a preemption or a wait: spent on the worker before the job continues

  friend bool operator==(const Overheads &, const Overheads &) = default;
};

/// A machine's overheads, as far as the simulator has them: it knows no stalls and no late releases.
[[nodiscard]] Overheads overheads_of(const redag::Overheads &machine);

struct Options {
  Duration horizon = kSecond;  // releases happen in [0, horizon); jobs unfinished at the horizon are in flight
  std::uint64_t seed = 1;      // of execution times and jitter (redag/derived/demand.hpp)
  Overheads overheads;
  /// Execution time of a job, before overheads; default: execution_time() of redag/derived/demand.hpp.
  std::function<Duration(const Task &, TaskId, std::uint32_t number)> demand;
  /// Length of a wait; default: wait_time().
  std::function<Duration(const Task &, TaskId, std::uint32_t number, std::size_t wait)> wait;
  /// Delay of a timer task's release after its nominal time; default: release_jitter().
  std::function<Duration(const Task &, TaskId, std::uint32_t number)> jitter;
  /// Gap added to the period before the next release (> -period); default: none, strictly periodic.
  std::function<Duration(const Task &, TaskId, std::uint32_t number)> gap;
};

/// Receives the events in decision order, one batch per instant. Returns false to end the simulation. If it is empty,
/// the scheduler records no events.
using EventSink = std::function<bool(std::span<const JobEvent>)>;

struct Result {
  std::uint64_t released = 0;
  std::uint64_t finished = 0;
  Time end = 0;  // the horizon, or when the sink ended the simulation
};

/// Simulates `workload` under `scheduler`, which must be fresh and built from the same workload. Order within one
/// instant: completions in the static order of tasks; then in the same order limits, waits that begin, and waits that
/// end; then releases by TaskId, preemption points by worker, and the decisions.
Result simulate(const Workload &workload, sched::Scheduler &scheduler, std::uint32_t workers, const Options &options,
                const EventSink &sink);

/// Least common multiple of the timer tasks' periods, or nothing if it exceeds `limit`.
[[nodiscard]] std::optional<Duration> hyperperiod(const Workload &workload, Duration limit = kMaxDuration);

}  // namespace redag::sim
