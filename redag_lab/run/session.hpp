// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs one executor on one workload, simulated or on threads. This is the one place where a run becomes a trace, a
// summary and a verdict of the trace checker. Prints nothing. Blocks until the run is over; one session at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/loader/calibration.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/check_report.hpp"
#include "redag_analysis/metrics/files/run_files.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/run/run_workload.hpp"
#include "redag_lab/run/variant.hpp"

namespace redag::lab {

/// The most events of a run that stay in memory, at 32 bytes each. Runs on threads of at most this length are checked
/// and written after their end, because the work would disturb them.
inline constexpr std::uint64_t kMostKeptEvents = std::uint64_t{1} << 22U;

struct SessionOptions : RunSettings {
  trace::Driver driver = trace::Driver::Simulator;
  /// Number of events that are checked and written, up to the end of an instant. Later events only enter the summary.
  std::uint64_t max_events = kMostKeptEvents;
  metrics::FilesOptions files;  // written while the run goes on, and completed by write_session()
  bool keep_trace = true;       // false: Session::trace has no events
  sim::Overheads overheads;     // simulator, like `demand` and `gap`
  decltype(sim::Options::demand) demand;
  decltype(sim::Options::gap) gap;
  std::vector<std::uint32_t> ranks;        // of executors::make_scheduler()
  std::optional<Calibration> calibration;  // overheads of a machine: simulated; on threads, charged to bounds
  Duration watchdog = 0;                   // threads: reports jobs that run for longer to `on_overdue` at once; 0: off
};

/// Called repeatedly while a session runs, with the time and, by DAG, the number of jobs so far that were late or lost.
using ProgressHook = std::function<void(Time now, const std::vector<std::uint64_t> &misses)>;

struct Session {
  trace::RunInfo info;
  metrics::Summary summary;                  // of the whole run
  trace::Trace trace;                        // its first events: at most kMostKeptEvents
  std::uint64_t checked = 0;                 // its events that were checked and written; all of them unless cut_at
  std::optional<Time> cut_at;                // `max_events` was reached: they are those of a run that ended here
  metrics::CheckReport check;                // of these events
  std::unique_ptr<metrics::RunFiles> files;  // of SessionOptions::files, not yet complete
  bool realtime_threads = false;             // the jobs ran on SCHED_FIFO threads
  std::uint64_t events = 0;                  // of the whole run
  Duration elapsed = 0;                      // wall-clock time of the run and its evaluation
  bool stopped = false;                      // ended by `stop`
  std::vector<std::string> warnings;         // caveats for a reader of the figures
};

/// Runs a session. `workload` must be valid. Errors: resources that the machine refused, an unwritable folder.
[[nodiscard]] Result<Session> run_session(const Workload &workload, const Variant &variant,
                                          const SessionOptions &options, const ProgressHook &progress = {});

/// Returns a warning if other programs keep the machine busy before a run on threads; nothing if it is quiet.
[[nodiscard]] std::optional<std::string> busy_machine_warning();

/// Returns the default length of a simulation: whole hyperperiods of at least 10 s, or of about 4 million jobs if that
/// is shorter. A hyperperiod longer than six times this length is ignored.
[[nodiscard]] Duration sensible_duration(const Workload &workload);

}  // namespace redag::lab
