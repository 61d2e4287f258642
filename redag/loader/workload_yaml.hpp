// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The text form of a workload (docs/workload_format.md): reading, with every mistake reported at its line, and writing.
// validate.hpp holds the rules about values. Pure functions, except those that read or write a file.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag/loader/validate.hpp"
#include "redag/model/workload.hpp"

namespace redag {

struct LoadedWorkload {
  Workload workload;
  Diagnostics warnings;
  bool states_workers = false;  // by `workers` or `cpus`; if not, `workload` has the format's default
};

/// What a file must state. LoadOptions{.wcet_optional = true} is for programs that run callbacks and measure them.
using LoadOptions = ValidateOptions;

/// The longest text that is read, in bytes. Its tree can take 260 times as much memory.
inline constexpr std::size_t kMaxWorkloadBytes = std::size_t{16} << 20U;

/// Reads and validates a file. Errors: all mistakes by line (with the warnings among them), or why the file cannot be
/// read.
[[nodiscard]] Result<LoadedWorkload> load_workload(const std::filesystem::path &path, LoadOptions options = {});

/// The same for text in memory. `file_name` is its name in diagnostics.
[[nodiscard]] Result<LoadedWorkload> parse_workload(std::string_view text, std::string file_name,
                                                    LoadOptions options = {});

/// parse_workload(to_yaml(w), name, options) gives w again. Requires that validate(w, options) has no errors.
[[nodiscard]] std::string to_yaml(const Workload &workload);

/// Writes to_yaml(workload). Errors: those of validate(), or why the file cannot be written.
[[nodiscard]] Result<void> save_workload(const Workload &workload, const std::filesystem::path &path,
                                         ValidateOptions options = {});

}  // namespace redag
