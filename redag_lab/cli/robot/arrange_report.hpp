// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `redag arrange` says: the plan, and what of it is not so yet. Pure.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/robot/changes.hpp"
#include "redag_lab/robot/plan.hpp"

namespace redag::cli {

/// The order as a table, and the priorities of each executor.
[[nodiscard]] std::string describe(const robot::Robot &robot, const robot::Plan &plan, const StreamTraits &terminal);

/// The differences as a table; a sentence if there are none.
[[nodiscard]] std::string describe(const robot::Changes &changes, const StreamTraits &terminal);

[[nodiscard]] Json to_json(const robot::Robot &robot, const robot::Plan &plan, const robot::Changes &changes);

}  // namespace redag::cli
