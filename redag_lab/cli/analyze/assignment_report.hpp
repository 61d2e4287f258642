// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `assign` says about an assignment of redag_lab/search: what it would change, what that gains, what else was
// tried. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/assignment.hpp"

namespace redag::cli {

struct Assigned {
  analysis::Assignment assignment;
  analysis::AnalysisPlatform platform;
  analysis::AssignmentOptions options;
};

/// One change a line: "policy: rate_monotonic -> fixed". Empty if nothing is better.
[[nodiscard]] std::vector<std::string> changes(const analysis::Assignment &assignment);

/// What is gained, and how sure it is that there is nothing better. Sentences, one a line.
[[nodiscard]] std::string in_words(const Assigned &assigned);

[[nodiscard]] std::string describe(const Assigned &assigned, const StreamTraits &terminal, bool all);

/// `redag.assignment/1`.
[[nodiscard]] Json to_json(const Assigned &assigned);

}  // namespace redag::cli
