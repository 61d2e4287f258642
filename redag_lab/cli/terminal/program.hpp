// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The program `redag` as a function: selects the subcommand, reports usage errors and prints help. main.cpp provides
// the process's arguments and streams.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

/// Runs the program. `arguments` excludes the program's name. Returns the exit status (commands.hpp), with all output
/// written.
[[nodiscard]] int run_program(const std::vector<std::string> &arguments, Console &console);

}  // namespace redag::cli
