// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents what `assign` does for a workload with clusters (redag_lab/search/placement.hpp). Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/search/placement.hpp"

namespace redag::cli {

/// Returns a table of the clusters with their DAGs, the changes, and a verdict.
[[nodiscard]] std::string describe(const lab::Placement &placement, const StreamTraits &terminal);

/// Returns `redag.placement/1`.
[[nodiscard]] Json to_json(const lab::Placement &placement);

}  // namespace redag::cli
