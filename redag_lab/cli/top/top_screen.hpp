// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The screen of `redag top` as lines of text: a pure function of what was read and of the state that keys change.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/styled.hpp"
#include "redag_lab/cli/top/live_graphs.hpp"
#include "redag_lab/cli/top/top_keys.hpp"

namespace redag::cli {

/// What there is to show.
struct TopInput {
  const std::vector<live::Listed> &pages;  // of the running executors
  const live::Listed *shown = nullptr;     // the executor, whose page is readable; null: none yet
  bool is_gone = false;                    // it has ended
  Time now = 0;                            // CLOCK_MONOTONIC
  const Course *course = nullptr;          // null: there is none
};

struct TopDrawing {
  std::vector<Line> lines;  // as many as the screen has, none wider
  TopPlaces places;
  std::size_t first = 0;  // the row at the top, which keeps the marked one in sight
};

[[nodiscard]] TopDrawing draw_top(const TopState &state, const TopInput &input, std::size_t columns, std::size_t lines,
                                  const Glyphs &glyphs);

/// Returns one frame for `--once`: the lines above the table, and all its rows. `width` 0: no limit.
[[nodiscard]] std::vector<Line> draw_once(const live::Listed &listed, const LiveView &view, Time now, std::size_t width,
                                          const Glyphs &glyphs);

/// Returns one line per executor, below a line of titles.
[[nodiscard]] std::string list_text(const std::vector<live::Listed> &pages, const StreamTraits &terminal, Time now);

}  // namespace redag::cli
