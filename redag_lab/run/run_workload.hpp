// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a whole workload on real threads, with synthetic bodies unless told otherwise, and returns its trace: the
// real-time counterpart of sim::simulate(). Blocks the calling thread, which collects events meanwhile and does no
// real-time work.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/watchdog.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/trace/flight_recorder.hpp"
#include "redag/trace/trace.hpp"

namespace redag::runtime {

/// Makes the scheduler of a run: ours, or a model of another executor.
using SchedulerFactory = std::function<std::unique_ptr<sched::Scheduler>(const Workload &, const sched::Config &)>;

/// The time that the scheduler sees; 0 before the start.
using Now = std::function<Time()>;

struct RunOptions {
  Duration duration = 10 * kSecond;          // releases in [0, duration); the trace ends there
  Duration warm_up = 0;                      // of it: noted in the trace, for the metrics to leave out
  std::uint64_t seed = 1;                    // execution times and jitter
  std::string executor = "redag";            // as in redag_analysis/executors/executors.hpp
  SchedulerFactory scheduler;                // instead of the one that `executor` names
  std::optional<PreemptionMode> preemption;  // instead of the workload's
  // os: jobs that can be started at once; 0: as many as the workload can have (most_started()), at most 1,024. Where
  // that is too few, a warning says so.
  std::uint32_t threads = 0;
  bool realtime_threads = false;  // none, cooperative: workers and release timer at SCHED_FIFO too
  Duration spin = 0;              // none, cooperative: how long a worker looks for a job before it sleeps
  bool lock_memory = false;       // if it cannot be had, a warning says so
  std::vector<int> cpus;          // processors of the workers; empty: os takes m of the usable ones
  std::size_t trace_capacity = std::size_t{1} << 17;  // events between two collections
  Duration drain_timeout = 5 * kSecond;               // for started jobs to end after the horizon
  /// What the jobs do besides, or instead: gets the synthetic bodies by TaskId and gives as many.
  std::function<std::vector<Body>(std::vector<Body> synthetic, const Now &now)> bodies;
  /// Names jobs that are in progress for too long, while they are: to on_overdue, on the calling thread, and in the
  /// result's `overdue`.
  std::optional<WatchdogOptions> watchdog;
  std::function<void(const std::string &text)> on_overdue;
  bool live = false;  // `redag top` sees the run
  /// For it: proven bounds on response times by task, 0 where there is none. Asked once, before the start.
  std::function<std::vector<Duration>(const sched::Config &)> bounds;
  /// Folder for a record of the run that outlives the process (trace/flight_recorder.hpp); empty: none. It stays when
  /// the run has ended: remove_flight_record() once the trace is kept elsewhere.
  std::string flight;
  trace::FlightOptions flight_options;
  const std::atomic<bool> *stop = nullptr;  // ends the run early when set (Ctrl-C)
  /// Takes the events of the run: about ten times a second those that are new, in the order of the trace, on the
  /// calling thread. The result's trace then holds none, so that memory does not grow with the run. `info` is what the
  /// result's will be, except `end` and `lost_events`.
  std::function<void(const trace::RunInfo &info, std::span<const JobEvent> events)> sink;
  /// About ten times a second, with all events so far; with a sink, with none. On the calling thread.
  std::function<void(Time now, std::span<const JobEvent> events)> progress;
};

struct RunResult {
  trace::Trace trace;  // from 0 to trace.info.end; jobs that had not ended by then are in flight; no events with a sink
  Mode mode;
  std::vector<Usage> usage;             // by task
  std::vector<std::string> unfinished;  // jobs that were told to give up after drain_timeout
  std::vector<std::string> overdue;     // what the watchdog said
  std::vector<std::string> warnings;    // what a reader of the figures should know
  bool stopped = false;                 // by `stop`
};

/// `workload` must be valid (validate()). Error: `os` or realtime_threads without the rights, threads that cannot be
/// made.
[[nodiscard]] Result<RunResult> run_workload(const Workload &workload, const RunOptions &options);

}  // namespace redag::runtime
