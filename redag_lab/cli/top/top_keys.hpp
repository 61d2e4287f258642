// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a key does in `redag top`: a state machine without terminal, clock or pages. Values and pure functions.
#pragma once

#include <cstddef>
#include <cstdint>

#include "redag_lab/cli/terminal/screen.hpp"
#include "redag_lab/cli/top/live_figures.hpp"

namespace redag::cli {

enum class TopMode : std::uint8_t {
  Table,  // DAGs and tasks
  Help,
};

struct TopState {
  LiveView view = {};
  TopMode mode = TopMode::Table;
  bool paused = false;
  std::size_t first = 0;  // the row at the top; draw_top() keeps it within the rows
  std::size_t page = 1;   // rows that fit, by draw_top()
};

enum class TopAction : std::uint8_t {
  None,
  Quit,
  Next,  // shows the next executor
};

/// Changes `state` as the key says. A key without meaning changes nothing.
[[nodiscard]] TopAction press(const KeyPress &key, TopState &state);

}  // namespace redag::cli
