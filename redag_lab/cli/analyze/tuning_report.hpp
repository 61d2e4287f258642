// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `tune` says: what it would change, what that gains on seeds that the search has not seen, what else was tried.
// Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/tune.hpp"

namespace redag::cli {

struct Tuning {
  tune::Tuned tuned;
  tune::Options options;
};

/// One change a line: "max_active of nav: none -> 2". Empty if nothing is better.
[[nodiscard]] std::vector<std::string> changes(const tune::Tuned &tuned);

/// Sentences, one a line.
[[nodiscard]] std::string in_words(const Tuning &tuning);

/// `all`: every combination tried.
[[nodiscard]] std::string describe(const Tuning &tuning, const StreamTraits &terminal, bool all);

/// `redag.tuning/1`.
[[nodiscard]] Json to_json(const Tuning &tuning);

}  // namespace redag::cli
