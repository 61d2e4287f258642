// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rows of a frame as a table that fits the terminal. Names are cut last: columns of figures are left out first, the
// least important ones before others. Pure function.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "redag_lab/cli/terminal/styled.hpp"
#include "redag_lab/cli/top/live_figures.hpp"
#include "redag_lab/cli/top/live_graphs.hpp"

namespace redag::cli {

/// The place of a column's title, [begin, end), and the order that a click on it chooses.
struct TitlePlace {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::optional<LiveOrder> order;
};

struct LiveTable {
  Line titles;
  std::vector<TitlePlace> places;
  std::vector<LiveRow> rows;
  std::vector<Line> lines;          // one for each row
  std::vector<std::string> hidden;  // titles of columns for which there is no room
};

/// `width` is in columns; 0: no limit. Without `course` there is no column of it.
[[nodiscard]] LiveTable make_table(const live::Frame &frame, const LiveView &view, const Course *course,
                                   std::size_t width, const Glyphs &glyphs);

}  // namespace redag::cli
