// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a key or a click does in `redag top`: a state machine without terminal, clock or pages. Values and pure
// functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag_lab/cli/terminal/screen.hpp"
#include "redag_lab/cli/top/live_figures.hpp"
#include "redag_lab/cli/top/live_table.hpp"

namespace redag::cli {

enum class TopMode : std::uint8_t {
  Table,   // the executor's DAGs and tasks
  Choose,  // the list of executors
  Help,
  Filter,  // a filter is being typed
  Search,  // a name to search for is being typed
};

struct TopState {
  LiveView view;
  TopMode mode = TopMode::Table;
  std::string typed;   // Filter, Search
  std::string sought;  // the last name searched for
  bool paused = false;
  std::size_t cursor = 0;  // the row that is marked
  std::size_t first = 0;   // the row, or the line of help, at the top
  std::size_t chosen = 0;  // Choose: the executor that is marked
};

/// What the screen showed, to which keys refer.
struct TopPlaces {
  std::vector<std::string> names;  // of all rows of the table
  std::size_t rows_line = 0;       // line of the first row shown
  std::size_t page = 1;            // number of rows, or lines of help, that fit
  std::size_t titles_line = 0;
  std::vector<TitlePlace> titles;
  std::size_t executors = 0;       // in the list
  std::size_t executors_line = 0;  // line of the first one shown
  std::size_t first_executor = 0;  // the first one shown
  std::size_t help_lines = 0;
  bool has_frame = false;  // an executor is shown behind the list
};

enum class TopAction : std::uint8_t {
  None,
  Quit,
  Attach,  // to the executor `chosen`
};

/// Changes `state` as the key says. A key without meaning changes nothing.
[[nodiscard]] TopAction press(const KeyPress &key, const TopPlaces &places, TopState &state);

}  // namespace redag::cli
