// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A table for people: aligned columns that fit the terminal. Where they do not, text columns are cut first, then the
// least important columns go, and a line below says which.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/text.hpp"
#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

struct Column {
  std::string title;
  bool number = false;      // right-aligned, never cut
  unsigned importance = 0;  // columns of lower importance go first; of equal ones the last
  bool whole = false;       // never cut, though text
};

struct Cell {
  std::string text;
  Tint tint = Tint::Plain;
};

class Table {
 public:
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}

  /// Missing cells at the end are empty. Requires no more cells than columns.
  void add(std::vector<Cell> row);

  /// `width` in columns, 0 for no limit. Ends with a newline.
  [[nodiscard]] std::string render(std::size_t width, bool colour) const;

 private:
  [[nodiscard]] std::vector<std::size_t> fit(std::size_t width, std::vector<std::size_t> &shown) const;

  /// Least width at which cells that differ still do.
  [[nodiscard]] std::size_t shortest_cut(std::size_t column) const;

  std::vector<Column> columns_;
  std::vector<std::vector<Cell>> rows_;
};

/// At most `width` columns of `text`, the end replaced by "…" where it is longer.
[[nodiscard]] std::string cut(std::string_view text, std::size_t width);

}  // namespace redag::cli
