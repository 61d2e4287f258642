// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The report as data ("redag.report/3", docs/results_format.md): groups of runs as one JSON text of bounded size. The
// page displays it, and other programs can read it. Pure function: equal runs give equal bytes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "redag_lab/report/digest.hpp"

namespace redag::report {

struct DocumentOptions {
  std::vector<std::string> notes;  // remarks for the reader that are not part of the runs
  Provenance provenance;           // of the report; each run has its own
  std::size_t most_tasks = 1000;   // all groups together; the tasks closest to a miss stay
};

/// Returns the report as one line of UTF-8, in which invalid bytes become U+FFFD. Requires at least one group, each of
/// them finished.
[[nodiscard]] std::string to_json(std::span<const Group> groups, const DocumentOptions &options = {});

/// Returns options with which a report of `groups` groups stays below 10 MB.
[[nodiscard]] DigestOptions digest_options(std::size_t groups);

}  // namespace redag::report
