// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <memory>

#include "redag_lab/cli/run/single_run.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {

namespace {

constexpr std::uint32_t kMaxFlightMib = 1U << 20U;

}  // namespace

Action add_run(CLI::App &app) {
  auto arguments = std::make_shared<RunArguments>();
  auto executor = std::make_shared<std::string>("redag");
  add_workload_arguments(app, *arguments);
  app.add_option("--executor", *executor, "As in simulate, also mte-fifo, ste-fifo, ...: those on real-time threads")
      ->type_name("NAME")
      ->capture_default_str();
  add_result_arguments(app, *arguments);
  app.add_flag("--all-tasks", arguments->all_tasks, "A row for every task, however many");
  add_thread_arguments(app, *arguments);
  add_calibration_argument(app, *arguments, "Threads");
  arguments->live = true;
  app.add_flag("--live,!--no-live", arguments->live, "Let redag top see the run (a page of memory, 2 updates a second)")
      ->group("Threads");
  arguments->flight = true;
  app.add_flag("--flight,!--no-flight", arguments->flight,
               "With --out, record events while the run goes on: 'redag recover' makes results of a killed run")
      ->group("Results");
  add_count(app, "--flight-size", arguments->flight_mib, {1, kMaxFlightMib},
            "MiB of that record; then new events replace the oldest")
      ->needs(&option_named(app, "--out"))
      ->group("Results");
  return [arguments, executor](Console &console) {
    return run_once(*arguments, *executor, trace::Driver::Threads, console);
  };
}

}  // namespace redag::cli
