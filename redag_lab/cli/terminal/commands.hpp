// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The subcommands. Each has one file, <name>_command.cpp, and one function. The function declares the options and
// returns the action to run after parsing.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

// Exit statuses for scripts.
inline constexpr int kExitOk = 0;
inline constexpr int kExitNo = 1;   // the command worked, and the answer is no
inline constexpr int kExitBad = 2;  // bad input, bad usage, or a result that could not be written

using Action = std::function<int(Console &)>;

Action add_validate(CLI::App &app);
Action add_generate(CLI::App &app);
Action add_import(CLI::App &app);
Action add_simulate(CLI::App &app);
Action add_run(CLI::App &app);
Action add_doctor(CLI::App &app);
Action add_compare(CLI::App &app);
Action add_analyze(CLI::App &app);
Action add_tune(CLI::App &app);
Action add_experiment(CLI::App &app);
Action add_events(CLI::App &app);
Action add_report(CLI::App &app);
Action add_top(CLI::App &app);
Action add_serve(CLI::App &app);
Action add_why(CLI::App &app);

}  // namespace redag::cli
