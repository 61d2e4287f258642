// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A self-check and a verdict in words, as tables, and as JSON. Pure functions.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/import/verdict.hpp"

namespace redag::cli {

/// Returns a table of recorded and simulated responses, and how many are reproduced.
[[nodiscard]] std::string describe(const lab::SelfCheck &check, const StreamTraits &terminal);

/// Returns a table of callbacks and chains under each executor, the callbacks without a verdict, and the changes.
[[nodiscard]] std::string describe(const lab::WhatIf &verdict, const Workload &workload, const StreamTraits &terminal);

/// Returns the document "redag.verdict/1" (docs/cli.md).
[[nodiscard]] Json to_json(const lab::WhatIf &verdict, const Workload &workload);

}  // namespace redag::cli
