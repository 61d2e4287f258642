// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents the result of `tune`: the changes, their gain, and the alternatives tried. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/tune.hpp"

namespace redag::cli {

struct Tuning {
  lab::Tuned tuned;
  lab::TuneOptions options;
};

/// Returns one line per change: "max_active of nav: none -> 2". Empty if no setting is better.
[[nodiscard]] std::vector<std::string> changes(const lab::Tuned &tuned);

/// Returns sentences, one per line.
[[nodiscard]] std::string in_words(const Tuning &tuning);

/// `all`: every combination tried.
[[nodiscard]] std::string describe(const Tuning &tuning, const StreamTraits &terminal, bool all);

/// Returns `redag.tuning/4`.
[[nodiscard]] Json to_json(const Tuning &tuning);

}  // namespace redag::cli
