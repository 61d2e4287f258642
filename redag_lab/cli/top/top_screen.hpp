// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The screen of `redag top` as lines of text with tinted()'s codes: pure functions of what was read and of the state
// that keys change.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag_lab/cli/top/top_keys.hpp"

namespace redag::cli {

/// What there is to show.
struct TopInput {
  const std::vector<live::Listed> &pages;  // of the running executors
  const live::Listed *shown = nullptr;     // the executor, whose page is readable; null: none yet
  bool is_gone = false;                    // it has ended
  Time now = 0;                            // CLOCK_MONOTONIC
};

/// Returns `lines` lines, none wider than `columns`. Keeps `state.first` within the rows, and sets `state.page`.
[[nodiscard]] std::vector<std::string> draw_top(TopState &state, const TopInput &input, std::size_t columns,
                                                std::size_t lines, bool colour);

/// Returns one frame for `--once`: the lines above the table, and all its rows. `width` 0: no limit.
[[nodiscard]] std::string draw_once(const live::Listed &listed, const LiveView &view, Time now, std::size_t width,
                                    bool colour);

}  // namespace redag::cli
