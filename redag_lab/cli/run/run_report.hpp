// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents a session to people, and writes its files. Pure, apart from the files.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/run/session.hpp"

namespace redag::cli {

struct ReportOptions {
  bool all_tasks = false;  // a row for every task, regardless of number
};

/// Returns a headline, a table of the tasks, a table of the DAGs, and the verdict of the trace checker.
[[nodiscard]] std::string describe(const lab::Session &session, const StreamTraits &terminal,
                                   const ReportOptions &options = {});

/// Returns "trace check: ok, 12 345 checks of 14 rules", or the violations.
[[nodiscard]] std::string describe_check(const metrics::CheckReport &check, const StreamTraits &terminal);

/// Returns the summary document (docs/results_format.md) with the checker's verdict as "check".
[[nodiscard]] Json to_json(const lab::Session &session);
[[nodiscard]] Json to_json(const metrics::CheckReport &check);

/// Writes jobs.csv, summary.json, trace.json and events.jsonl into an existing folder, and continues after a failure.
/// Returns the errors.
[[nodiscard]] Diagnostics write_session(const lab::Session &session, const std::string &folder);

}  // namespace redag::cli
