// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents the results of `redag experiment factorial`. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/experiment/factorial_results.hpp"

namespace redag::cli {

/// Returns the misses of each executor with its best and worst combination, the effects of the factors, and the trace
/// checker's verdict. Adds a row for each combination if there are few.
[[nodiscard]] std::string describe(const experiment::Factorial &factorial, const experiment::FactorialResults &results,
                                   const StreamTraits &traits);

}  // namespace redag::cli
