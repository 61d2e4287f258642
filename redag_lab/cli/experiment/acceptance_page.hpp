// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The page of `redag report` for an acceptance experiment: the plot, the figures, the plan, and where every unit comes
// from. One HTML file without scripts. Pure function.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/experiment/acceptance_results.hpp"

namespace redag::cli {

/// `runs` holds JSON texts (redag_lab/experiment/folder.hpp).
[[nodiscard]] std::string acceptance_page(const experiment::Acceptance &acceptance,
                                          const experiment::AcceptanceResults &results,
                                          const std::vector<std::string> &runs);

}  // namespace redag::cli
