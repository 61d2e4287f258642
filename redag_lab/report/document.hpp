// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The report as data ("redag.report/2", docs/results_format.md): groups of runs as one JSON text of bounded size. The
// page shows it; other programs can read it. Pure function: equal runs give equal bytes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "redag_lab/report/digest.hpp"

namespace redag::report {

struct DocumentOptions {
  std::vector<std::string> notes;  // what a reader should know that the runs do not say
  Provenance provenance;           // of the report; that of each run stands beside the run
  std::size_t most_tasks = 2000;   // rows of tables, all groups together; those closest to a miss stay
  std::size_t most_curves = 600;   // tasks with a distribution, all groups together
};

/// One line of UTF-8; bytes that are not become U+FFFD. Requires groups, finished.
[[nodiscard]] std::string to_json(std::span<const Group> groups, const DocumentOptions &options = {});

/// The names of the workloads.
[[nodiscard]] std::string title_of(std::span<const Group> groups);

/// What the options for `groups` groups have to be so that a report stays below 10 MB.
[[nodiscard]] DigestOptions digest_options(std::size_t groups);

}  // namespace redag::report
