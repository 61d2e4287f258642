// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a person is shown of a session, and the files that it leaves. Pure but for the files.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/run/session.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"

namespace redag::cli {

struct ReportOptions {
  bool all_tasks = false;  // a row for every task, however many
};

/// Headline, a table of the tasks, a table of the DAGs, the verdict of the trace checker.
[[nodiscard]] std::string describe(const Session &session, const StreamTraits &terminal,
                                   const ReportOptions &options = {});

/// "trace check: ok, 12 345 checks of 14 rules", or the violations.
[[nodiscard]] std::string describe_check(const metrics::CheckReport &check, const StreamTraits &terminal);

/// The summary document (docs/results_format.md) with the verdict of the checker as "check".
[[nodiscard]] Json to_json(const Session &session);
[[nodiscard]] Json to_json(const metrics::CheckReport &check);

/// Writes jobs.csv, summary.json, trace.json and events.jsonl into a folder that exists; goes on after a failure.
/// Returns what went wrong.
[[nodiscard]] Diagnostics write_session(const Session &session, const std::string &folder);

}  // namespace redag::cli
