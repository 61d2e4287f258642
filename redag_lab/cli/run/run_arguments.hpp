// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Arguments common to `simulate`, `run` and `compare`: the workload and changes to it, length, seed, and result folder.
// Also the shared steps from there to a session. `analyze` uses the workload's part. Not thread-safe.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/loader/calibration.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/progress.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"

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
  std::uint64_t max_events = lab::kMostKeptEvents;
  std::string cpus;
  bool lock_memory = false;
  bool realtime_threads = false;
  Duration spin = 0;
  std::optional<Duration> watchdog;
  bool live = false;
  bool json = false;
  std::string folder;
  bool record = false;  // records the run in `folder` while it runs
  std::uint32_t record_mib = static_cast<std::uint32_t>(trace::kMostRecordBytes >> 20U);
  bool check = false;
  bool all_tasks = false;
};

/// Adds the options that replace the workload's platform and policy.
void add_platform_arguments(CLI::App &app, RunArguments &arguments);
/// Adds --overheads FILE, which is read at once.
CLI::Option *add_calibration_argument(CLI::App &app, RunArguments &arguments, const std::string &group);
/// Adds --overheads FILE and one option for each overhead.
void add_overhead_arguments(CLI::App &app, RunArguments &arguments, const std::string &group);
void add_workload_arguments(CLI::App &app, RunArguments &arguments,
                            const char *file_help = "Workload file (YAML); - reads standard input");
void add_result_arguments(CLI::App &app, RunArguments &arguments);
void add_simulator_arguments(CLI::App &app, RunArguments &arguments);
void add_thread_arguments(CLI::App &app, RunArguments &arguments);

/// Returns the workload of `arguments.file` with the changes of the command line, and prints warnings and errors.
/// Returns nothing if the workload cannot be run. Leaves the text of the file in `source`, if that is given.
[[nodiscard]] std::optional<Workload> load_configured(const RunArguments &arguments, Console &console,
                                                      LoadOptions options = {}, std::string *source = nullptr);
/// The same for a command that changes tasks and cannot use a workload with clusters.
[[nodiscard]] std::optional<Workload> load_without_clusters(const RunArguments &arguments, const char *command,
                                                            Console &console, std::string *source = nullptr);

/// Writes `workload`, a change of the one that `source` states, to the file `path`, and says so. Keeps the rest of the
/// text. Nothing happens without a path. Returns false after printing an error.
[[nodiscard]] bool write_changed(const std::string &path, const std::string &source, const Workload &workload,
                                 Console &console);

/// Returns false, with an error, if the command line requests a mode, a policy or workers that none of the executors
/// takes.
[[nodiscard]] bool takes_arguments(const std::vector<lab::Variant> &variants, const RunArguments &arguments,
                                   Console &console);

/// Returns the options of a session, except `stop`. `default_duration` applies if no duration is given. Errors are
/// printed.
[[nodiscard]] std::optional<lab::SessionOptions> session_options(const RunArguments &arguments, trace::Driver driver,
                                                                 Duration default_duration, Console &console);

/// Draws `progress` over a session of `duration`: the time, and the DAGs with misses.
[[nodiscard]] lab::ProgressHook progress_hook(Progress &progress, const Workload &workload, Duration duration);

}  // namespace redag::cli
