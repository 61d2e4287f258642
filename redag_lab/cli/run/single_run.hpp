// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shared by `simulate` and `run`: executes one session, shows it and writes its files. Blocks until it is over or
// interrupted.
#pragma once

#include <string>

#include "redag/trace/trace.hpp"
#include "redag_lab/cli/run/run_arguments.hpp"
#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

/// Returns the exit status. `executor` is a name of variant.hpp.
[[nodiscard]] int run_once(const RunArguments &arguments, const std::string &executor, trace::Driver driver,
                           Console &console);

}  // namespace redag::cli
