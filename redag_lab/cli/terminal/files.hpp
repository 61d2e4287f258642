// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files of commands: reading a workload ("-" is standard input), writing one text file, and result folders. Result
// folders are created if missing. Not thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/robot/input.hpp"

namespace redag::cli {

/// Reads a workload or a robot from a file, or from standard input if `path` is "-". Leaves its text in `source`, if
/// that is given.
[[nodiscard]] Result<robot::Input> load_workload_or_robot(const std::string &path, LoadOptions options = {},
                                                          std::string *source = nullptr);

/// Writes a whole file or nothing (trace::OutputFile). Devices and pipes are written directly.
[[nodiscard]] Result<void> write_text(const std::string &path, std::string_view text);

/// Checks that write_text() can write there, before a long computation.
[[nodiscard]] Result<void> check_output(const std::string &path);

/// Prepares a folder for results, creating it and its parents if missing. Error: the folder cannot be created or
/// written. Nothing is deleted.
[[nodiscard]] Result<void> prepare_folder(const std::string &path);

/// Returns the traces at a place, sorted: the file itself, or every events.redag in the folder and
/// below. Error: none found.
[[nodiscard]] Result<std::vector<std::string>> find_traces(const std::string &place);

}  // namespace redag::cli
