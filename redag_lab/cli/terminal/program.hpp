// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The program `redag` as a function: which subcommand, usage errors, help. main.cpp gives it the process's arguments
// and streams.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

/// `arguments` without the program's name. Returns the exit status (commands.hpp); nothing is left unwritten.
[[nodiscard]] int run_program(const std::vector<std::string> &arguments, Console &console);

}  // namespace redag::cli
