// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <memory>

#include "redag_lab/cli/run/single_run.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {

namespace {

constexpr std::uint32_t kMaxRecordMib = 1U << 20U;

}  // namespace

Action add_run(CLI::App &app) {
  auto arguments = std::make_shared<RunArguments>();
  auto executor = std::make_shared<std::string>("redag");
  add_workload_arguments(app, *arguments);
  app.add_option("--executor", *executor,
                 "Executor: as for 'redag simulate', and also mte-fifo, ste-fifo, ..., which use real-time threads")
      ->type_name("NAME")
      ->capture_default_str();
  add_result_arguments(app, *arguments);
  app.add_flag("--all-tasks", arguments->all_tasks, "Show every task, however many there are");
  add_thread_arguments(app, *arguments);
  add_calibration_argument(app, *arguments, "Threads");
  arguments->live = true;
  app.add_flag("--live,!--no-live", arguments->live,
               "Let 'redag top' show the run; costs a page of memory and two updates a second")
      ->group("Threads");
  arguments->record = true;
  add_count(app, "--record-size", arguments->record_mib, {1, kMaxRecordMib},
            "Size of the events on disk during the run, in MiB; then new events replace the oldest")
      ->needs(&option_named(app, "--out"))
      ->group("Results");
  return [arguments, executor](Console &console) {
    return run_once(*arguments, *executor, trace::Driver::Threads, console);
  };
}

}  // namespace redag::cli
