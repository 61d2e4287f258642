// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// RunInfo as a JSON object: the "run" of events.jsonl, summary.json and flight records. The workload stands in it as
// its YAML text. Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

/// One line, without a line break. Requires that validate(info.workload, {.wcet_optional = true}) has no
/// errors.
[[nodiscard]] std::string run_info_to_json(const RunInfo &info);

/// The reverse. Errors (missing or ill-typed keys, an invalid workload) name `file` and `line`.
[[nodiscard]] Result<RunInfo> run_info_from_json(std::string_view text, const std::string &file, int line);

/// What a file of a run begins with: its format, where it comes from, the run. The same requirements.
[[nodiscard]] std::string run_header_to_json(std::string_view format, const RunInfo &info);

/// The reverse, for line 1 of a file; `what` says what it should be ("an event trace").
[[nodiscard]] Result<RunInfo> run_header_from_json(std::string_view text, std::string_view format, const char *what,
                                                   const std::string &file);

}  // namespace redag::trace
