// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents the results of `redag experiment acceptance`. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/experiment/acceptance_results.hpp"

namespace redag::cli {

/// Returns a table for each combination of the plan, with a row per utilization and a column per method.
[[nodiscard]] std::string describe(const experiment::Acceptance &acceptance,
                                   const experiment::AcceptanceResults &results, const StreamTraits &traits);

}  // namespace redag::cli
