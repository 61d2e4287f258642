// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A frame of a live page as JSON, for programs and for the page of `redag serve` (docs/live_page.md). Pure functions.
#pragma once

#include <vector>

#include "redag/live/reader.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/cli/top/live_figures.hpp"

namespace redag::cli {

/// Returns "redag.live/1". `now` is CLOCK_MONOTONIC.
[[nodiscard]] Json to_json(const live::Listed &listed, const live::Page &page, Time now);
/// Returns "redag.live-list/1".
[[nodiscard]] Json to_json(const std::vector<live::Listed> &pages, Time now);
/// Returns "redag.live-all/1": the rows of all executors. Requires `view.all`.
[[nodiscard]] Json machine_json(const std::vector<live::Listed> &pages, const LiveView &view);

}  // namespace redag::cli
