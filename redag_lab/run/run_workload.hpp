// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a whole workload on real threads and returns its trace: the real-time counterpart of sim::simulate(). The bodies
// are synthetic by default. Blocks the calling thread, which collects events meanwhile and does no real-time work.
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
#include "redag/engine/engine.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/watchdog.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/trace.hpp"

namespace redag::lab {

/// Creates the scheduler of a run: ours, or a model of another executor.
using SchedulerFactory = std::function<std::unique_ptr<sched::Scheduler>(const Workload &, const sched::Config &)>;

/// Returns the scheduler's time; 0 before the start.
using Now = std::function<Time()>;

/// What a user chooses for any run.
struct RunSettings {
  Duration duration = 10 * kSecond;  // releases in [0, duration); the trace ends there
  Duration warm_up = 0;              // recorded in the trace; the metrics leave it out
  std::uint64_t seed = 1;            // of execution times and jitter
  bool realtime_threads = false;     // none, cooperative: workers and release timer on SCHED_FIFO too
  Duration spin = 0;                 // none, cooperative: how long a worker looks for a job before it sleeps
  bool lock_memory = false;          // a warning reports a refusal
  std::vector<int> cpus;             // processors of the workers; empty: os takes m of the usable ones
  bool live = false;                 // publishes a live page for `redag top`
  /// File for a record of the run that outlives the process (trace::EventsWriter::record()); empty: none. It is not
  /// completed after the run: the caller replaces it by the trace.
  std::string record;
  std::uint64_t record_bytes = trace::kMostRecordBytes;
  const std::atomic<bool> *stop = nullptr;                  // ends the run early when set (Ctrl-C)
  std::function<void(const std::string &text)> on_overdue;  // receives what the watchdog reports, while the run goes on
};

struct RunOptions : RunSettings {
  std::string executor = "redag";            // a name of redag_analysis/executors/executors.hpp
  SchedulerFactory scheduler;                // replaces the one that `executor` names
  std::optional<PreemptionMode> preemption;  // replaces the workload's
  // os: jobs that can be started at once. 0: as many as the workload can have (most_started()), at most 1,024. A
  // warning reports a number that is too small.
  std::uint32_t threads = 0;
  std::size_t trace_capacity = std::size_t{1} << 17;  // events between two collections
  Duration drain_timeout = 5 * kSecond;               // for started jobs to end after the horizon
  /// Adds to the jobs' work or replaces it: receives the synthetic bodies by TaskId and returns as many.
  std::function<std::vector<runtime::Body>(std::vector<runtime::Body> synthetic, const Now &now)> bodies;
  /// Reports overdue jobs while they still run, to on_overdue on the calling thread and in the result's `overdue`.
  std::optional<runtime::WatchdogOptions> watchdog;
  /// For the live page: proven bounds on response times by task, 0 where there is none. Called once, before the start.
  std::function<std::vector<Duration>(const sched::Config &)> bounds;
  /// Takes the new events about ten times a second, in the order of the trace, on the calling thread. The result's
  /// trace then holds none, and memory does not grow with the run. `info` is that of the result, except `end` and
  /// `lost_events`.
  std::function<void(const trace::RunInfo &info, std::span<const JobEvent> events)> sink;
  /// Called about ten times a second on the calling thread, with all events so far; with a sink, without events.
  std::function<void(Time now, std::span<const JobEvent> events)> progress;
};

struct RunResult {
  trace::Trace trace;  // from 0 to trace.info.end; unfinished jobs are in flight; no events with a sink
  runtime::Mode mode;
  std::vector<runtime::Usage> usage;    // by task
  std::vector<std::string> unfinished;  // jobs that were told to give up after drain_timeout
  std::vector<std::string> overdue;     // the watchdog's reports
  std::vector<std::string> warnings;    // caveats for a reader of the figures
  bool stopped = false;                 // ended by `stop`
};

/// Runs a workload, which must be valid (validate()). Error: `os` or realtime_threads without the rights, or threads
/// that cannot be created.
[[nodiscard]] Result<RunResult> run_workload(const Workload &workload, const RunOptions &options);

}  // namespace redag::lab
