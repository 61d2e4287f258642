// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `simulate`, `run` and `compare` ask for alike: the workload and changes to it, length, seed, where results go.
// The steps that they share from there to a session. `analyze` takes the workload's part. Not thread-safe.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/model/overheads.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/cli/run/session.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/cli/terminal/variant.hpp"

namespace redag::cli {

struct RunArguments {
  std::string file;
  std::optional<PolicyKind> policy;
  std::optional<Ties> ties;
  std::optional<PreemptionMode> preemption;
  std::uint32_t workers = 0;  // 0: the workload's
  std::optional<Duration> duration;
  Duration warm_up = 0;
  std::uint64_t seed = 1;
  sim::Overheads overheads;
  std::optional<Calibration> calibration;  // --overheads
  std::uint64_t max_events = std::uint64_t{1} << 22U;
  std::string cpus;
  bool lock_memory = false;
  bool realtime_threads = false;
  Duration spin = 0;
  std::optional<Duration> watchdog;
  bool live = false;
  bool json = false;
  std::string folder;
  bool flight = false;  // a record of the run in `folder`, while it goes on
  std::uint32_t flight_mib = static_cast<std::uint32_t>(trace::FlightOptions{}.most_bytes >> 20U);
  bool force = false;
  bool check = false;
  bool all_tasks = false;
};

/// What replaces the platform and the policy of the workload.
void add_platform_arguments(CLI::App &app, RunArguments &arguments);
/// --overheads FILE, which is read at once.
CLI::Option *add_calibration_argument(CLI::App &app, RunArguments &arguments, const std::string &group);
/// The same, and its parts one by one.
void add_overhead_arguments(CLI::App &app, RunArguments &arguments, const std::string &group);
void add_workload_arguments(CLI::App &app, RunArguments &arguments);
void add_result_arguments(CLI::App &app, RunArguments &arguments);
void add_simulator_arguments(CLI::App &app, RunArguments &arguments);
void add_thread_arguments(CLI::App &app, RunArguments &arguments);

/// The workload of `arguments.file` with what the command line changes; warnings and errors are printed. Nothing if it
/// cannot be run.
[[nodiscard]] std::optional<Workload> load_configured(const RunArguments &arguments, Console &console);

/// False, with an error, if the command line asks for a mode, a policy or workers that none of the executors takes.
[[nodiscard]] bool takes_arguments(const std::vector<Variant> &variants, const RunArguments &arguments,
                                   Console &console);

/// Everything but the driver, which is `driver`, and `stop`. `default_duration` where none is given. Errors are
/// printed.
[[nodiscard]] std::optional<SessionOptions> session_options(const RunArguments &arguments, trace::Driver driver,
                                                            Duration default_duration, Console &console);

/// Draws `progress` over a session of `duration`: time, and the DAGs with misses.
[[nodiscard]] ProgressHook progress_hook(Progress &progress, const Workload &workload, Duration duration);

}  // namespace redag::cli
