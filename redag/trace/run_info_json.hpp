// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// RunInfo as a JSON object: the "run" of events.redag and summary.json. It contains the workload as
// YAML text. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

/// The longest description of a run that is read. Its workload has at most kMaxWorkloadBytes.
inline constexpr std::uint64_t kMaxInfoBytes = std::uint64_t{64} << 20U;

/// Returns one line without a line break. Requires that validate(info.workload) finds no errors but a missing wcet, and
/// allows waits.
[[nodiscard]] std::string run_info_to_json(const RunInfo &info);

/// Reads run_info_to_json(). Errors (missing or ill-typed keys, an invalid workload) name `file` and `line`.
[[nodiscard]] Result<RunInfo> run_info_from_json(std::string_view text, const std::string &file, int line);

/// Returns the first line of a file about a run: its format, its provenance, the run. Requires what run_info_to_json()
/// does.
[[nodiscard]] std::string run_header_to_json(std::string_view format, const RunInfo &info);

/// Reads line 1 of such a file; `what` says what it should be ("an event trace").
[[nodiscard]] Result<RunInfo> run_header_from_json(std::string_view text, std::string_view format, const char *what,
                                                   const std::string &file);

}  // namespace redag::trace
