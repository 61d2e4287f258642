// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `redag experiment` prints for people. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/experiment/acceptance_results.hpp"

namespace redag::cli {

/// A table for each combination of the plan: a row a utilization, a column a method.
[[nodiscard]] std::string describe(const experiment::Acceptance &acceptance,
                                   const experiment::AcceptanceResults &results, const StreamTraits &traits);

}  // namespace redag::cli
