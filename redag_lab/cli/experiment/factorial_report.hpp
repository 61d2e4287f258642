// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `redag experiment factorial` prints for people. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/experiment/factorial_results.hpp"

namespace redag::cli {

/// Who misses how much, at which combination most and least; a row for each combination where they are few; what each
/// factor explains; what the trace checker says.
[[nodiscard]] std::string describe(const experiment::Factorial &factorial, const experiment::FactorialResults &results,
                                   const StreamTraits &traits);

}  // namespace redag::cli
