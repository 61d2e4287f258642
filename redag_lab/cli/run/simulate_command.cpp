// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <memory>
#include <string>

#include "redag_lab/cli/run/single_run.hpp"
#include "redag_lab/cli/terminal/commands.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {

Action add_simulate(CLI::App &app) {
  auto arguments = std::make_shared<RunArguments>();
  auto executor = std::make_shared<std::string>("redag");
  add_workload_arguments(app, *arguments);
  app.add_option("--executor", *executor,
                 "Executor: redag, redag-none, redag-cooperative, redag-os, mte, ste, static, events or cbg")
      ->type_name("NAME")
      ->capture_default_str();
  add_result_arguments(app, *arguments);
  app.add_flag("--all-tasks", arguments->all_tasks, "Show every task, however many there are");
  add_simulator_arguments(app, *arguments);
  return [arguments, executor](Console &console) {
    return run_once(*arguments, *executor, trace::Driver::Simulator, console);
  };
}

}  // namespace redag::cli
