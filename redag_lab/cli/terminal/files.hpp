// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files on behalf of commands: reading a workload ("-" is standard input), writing one text file, and result folders,
// which are made when missing and never mixed with somebody else's files. Not thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload_yaml.hpp"

namespace redag::cli {

/// load_workload(), or the text on standard input if `path` is "-".
[[nodiscard]] Result<LoadedWorkload> load_input(const std::string &path, LoadOptions options = {});

/// Writes a whole file or nothing (trace::OutputFile); devices and pipes are written as they are.
[[nodiscard]] Result<void> write_text(const std::string &path, std::string_view text);

/// Can write_text() write there? For commands that compute for long before they do.
[[nodiscard]] Result<void> check_output(const std::string &path);

/// A folder that results can go to: made with its parents if missing. Error if it holds a file that this program does
/// not write, by name (unless `force`), or cannot be made or written. Nothing is deleted.
[[nodiscard]] Result<void> prepare_folder(const std::string &path, bool force);

/// Where `redag run` records a run in its result folder while it goes on (trace/flight_recorder.hpp).
[[nodiscard]] std::string flight_folder(const std::string &folder);

/// The traces at a place, sorted: the file itself, or every events.jsonl in the folder and below. Error if there is
/// none.
[[nodiscard]] Result<std::vector<std::string>> find_traces(const std::string &place);

/// Is this the name of something that a command writes into a result folder?
[[nodiscard]] bool is_result_name(std::string_view name);

}  // namespace redag::cli
