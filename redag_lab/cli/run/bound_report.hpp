// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A check of bounds in words and as JSON. Pure functions.
#pragma once

#include <cstddef>
#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/run/bound_check.hpp"

namespace redag::cli {

[[nodiscard]] std::string describe(const lab::BoundCheck &check, std::size_t tasks, const StreamTraits &terminal);
[[nodiscard]] Json to_json(const lab::BoundCheck &check);

}  // namespace redag::cli
