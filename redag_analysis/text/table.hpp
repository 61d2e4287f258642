// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A table for people, with aligned columns that fit the terminal. If they do not fit, text columns are cut first. Then
// the least important columns are left out, and a line below names them.
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
  bool whole = false;       // never cut, although it is text
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

 private:
  [[nodiscard]] std::vector<std::size_t> fit(std::size_t width, std::vector<std::size_t> &shown) const;

  /// Returns the least width at which cells that differ remain different.
  [[nodiscard]] std::size_t shortest_cut(std::size_t column) const;

  std::vector<Column> columns_;
  std::vector<std::vector<Cell>> rows_;
};

}  // namespace redag
