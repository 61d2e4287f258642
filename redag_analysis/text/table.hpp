// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A table for people, with aligned columns that fit the terminal. If they do not fit, prose wraps at words. Then the
// least important columns are left out, and a line below names them. Names are cut last: text columns that no number
// exceeds in importance.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag_analysis/text/tint.hpp"

namespace redag {

struct Column {
  std::string title;
  bool number = false;      // right-aligned, never cut
  unsigned importance = 0;  // columns of lower importance are left out first; among equals the last
  bool prose = false;       // text that wraps at words
};

struct Cell {
  std::string text;
  Tint tint = Tint::Plain;
};

class Table {
 public:
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}

  /// Adds a row. Missing cells at the end are empty. Requires no more cells than columns.
  void add(std::vector<Cell> row);

  /// Renders the table, with a newline at the end. `width` is in columns; 0: no limit.
  [[nodiscard]] std::string render(std::size_t width, bool colour) const;

  /// Returns the titles and the rows as lines, without the names of columns that found no room.
  [[nodiscard]] std::vector<std::string> lines(std::size_t width, bool colour) const;

 private:
  class Layout;
  [[nodiscard]] std::vector<std::string> lines(const Layout &layout, bool colour) const;

  std::vector<Column> columns_;
  std::vector<std::vector<Cell>> rows_;
};

}  // namespace redag
