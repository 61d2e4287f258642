// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// TextTable renders a table as plain text. The first columns are aligned to the left, the others to the right. Not
// thread-safe.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace redag_rclcpp::lab {

class TextTable {
 public:
  /// `left`: number of columns, from the first, that are aligned to the left.
  explicit TextTable(std::vector<std::string> header, std::size_t left = 1) : left_(left) {
    rows_.push_back(std::move(header));
  }

  /// `row` has as many cells as the header.
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }

  [[nodiscard]] std::string render() const {
    std::vector<std::size_t> widths(rows_.front().size(), 0);
    for (const auto &row : rows_) {
      for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], width_of(row[i]));
    }
    std::string text;
    for (const auto &row : rows_) {
      std::string line;
      for (std::size_t i = 0; i < row.size(); ++i) {
        const std::string padding(widths[i] - width_of(row[i]), ' ');
        line += (i == 0 ? "" : "  ") + (i < left_ ? row[i] + padding : padding + row[i]);
      }
      text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
    }
    return text;
  }

 private:
  // Width in characters, not bytes: "µs" has three bytes and two characters.
  static std::size_t width_of(const std::string &text) {
    std::size_t width = 0;
    for (const char c : text) width += (static_cast<unsigned char>(c) & 0xC0U) != 0x80U ? 1 : 0;
    return width;
  }

  std::size_t left_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace redag_rclcpp::lab
