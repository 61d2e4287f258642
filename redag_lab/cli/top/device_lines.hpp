// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The devices of an executor in `redag top`: a line each, below titles. Pure functions.
#pragma once

#include <cstddef>
#include <vector>

#include "redag/live/frame.hpp"
#include "redag_lab/cli/terminal/styled.hpp"
#include "redag_lab/cli/top/live_graphs.hpp"

namespace redag::cli {

/// Returns the lines, at most `most` with their titles; none if there is no device, or no room for one. On a narrow
/// terminal, columns are left out before a name is cut.
[[nodiscard]] std::vector<Line> device_lines(const live::Frame &frame, bool since_start, std::size_t width,
                                             std::size_t most, const Glyphs &glyphs);

}  // namespace redag::cli
