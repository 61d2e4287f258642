// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents the result of `assign` (redag_lab/search): the changes, their gain, and the alternatives tried. Pure
// functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/assignment.hpp"

namespace redag::cli {

struct Assigned {
  lab::Assignment assignment;
  analysis::AnalysisPlatform platform;
  lab::AssignmentOptions options;
};

/// Returns one line per change: "policy: rate_monotonic -> fixed". Empty if no candidate is better.
[[nodiscard]] std::vector<std::string> changes(const lab::Assignment &assignment);

/// Returns the gain, and how certain it is that no better candidate exists. Sentences, one per line.
[[nodiscard]] std::string in_words(const Assigned &assigned);

[[nodiscard]] std::string describe(const Assigned &assigned, const StreamTraits &terminal, bool all);

/// Returns `redag.assignment/1`.
[[nodiscard]] Json to_json(const Assigned &assigned);

}  // namespace redag::cli
