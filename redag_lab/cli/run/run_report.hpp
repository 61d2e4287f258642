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

struct WrittenFiles {
  Diagnostics problems;  // what could not be written
  std::string names;     // "summary.json, jobs.csv, events.redag, trace.pftrace"
  bool has_picture = false;
  std::string no_picture;  // why there is no trace.pftrace; empty: there is one, or none was wanted
};

/// Completes session.files, or writes such files of session.trace, and adds summary.json. The folder must exist.
/// Continues after a failure.
[[nodiscard]] WrittenFiles write_session(lab::Session &session, const metrics::FilesOptions &options);

}  // namespace redag::cli
