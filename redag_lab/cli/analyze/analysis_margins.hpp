// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents the margins of redag_lab/search for `analyze --sensitivity`, as a table and as JSON. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/analysed.hpp"
#include "redag_lab/search/sensitivity.hpp"

namespace redag::cli {

/// Returns "wcet of slow.plan", "all wcets", "period of fast" or "all rates".
[[nodiscard]] std::string knob_name(const lab::Analysed &analysed, const lab::Knob &knob);

/// Returns a line for each margin. `all`: regardless of number.
[[nodiscard]] std::string describe(const lab::Analysed &analysed, const std::vector<lab::Margin> &margins,
                                   const StreamTraits &terminal, bool all);

/// Returns the `limits` of `redag.analysis/1`.
[[nodiscard]] Json to_json(const lab::Analysed &analysed, const std::vector<lab::Margin> &margins);

}  // namespace redag::cli
