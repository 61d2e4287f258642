// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A comparison in words, as a table, and as JSON. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/run/comparison.hpp"

namespace redag::cli {

/// Returns sentences such as "control: redag misses none, mte 14.2 %, ste 30.1 %: redag misses fewest".
[[nodiscard]] std::vector<std::string> verdicts(const lab::Comparison &comparison);

/// Returns a caution if only some executors had real-time threads; otherwise empty.
[[nodiscard]] std::string caveat(const lab::Comparison &comparison);

[[nodiscard]] std::string describe(const lab::Comparison &comparison, const StreamTraits &terminal);
[[nodiscard]] Json to_json(const lab::Comparison &comparison);
}  // namespace redag::cli
