// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "redag/base/check.hpp"

namespace redag {
namespace {

constexpr std::size_t kGap = 2;          // between columns
constexpr std::size_t kShortestCut = 8;  // a text column is not cut below this
constexpr std::size_t kLongestCut = 24;  // nor below the width at which its cells differ, up to this limit

std::string padded(const std::string &text, std::size_t width, bool right) {
  const std::size_t used = display_width(text);
  const std::string space(width > used ? width - used : 0, ' ');
  return right ? space + text : text + space;
}

}  // namespace

std::size_t Table::shortest_cut(std::size_t column) const {
  const auto different = [&](std::size_t width) {
    std::set<std::string> texts;
    for (const auto &row : rows_) texts.insert(cut(row[column].text, width));
    return texts.size();
  };
  const std::size_t all = different(kLongestCut);
  std::size_t width = kShortestCut;
  while (width < kLongestCut && different(width) < all) ++width;
  return width;
}

void Table::add(std::vector<Cell> row) {
  REDAG_CHECK(row.size() <= columns_.size(), "a row has more cells than the table has columns");
  row.resize(columns_.size());
  rows_.push_back(std::move(row));
}

// Returns the widths of the columns, and removes from `shown` those that do not fit.
std::vector<std::size_t> Table::fit(std::size_t width, std::vector<std::size_t> &shown) const {
  std::vector<std::size_t> widths(columns_.size());
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    widths[i] = display_width(columns_[i].title);
    for (const auto &row : rows_) widths[i] = std::max(widths[i], display_width(row[i].text));
  }
  const auto excess = [&]() -> std::size_t {
    std::size_t total = kGap * (shown.size() - 1);
    for (const std::size_t i : shown) total += widths[i];
    return width > 0 && total > width ? total - width : 0;
  };
  std::vector<std::size_t> least = widths;
  if (excess() > 0) {
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (!columns_[i].number && !columns_[i].whole) least[i] = shortest_cut(i);
    }
  }
  const auto cut_widest_text = [&] {
    const auto can_shrink = [&](std::size_t i) { return widths[i] > least[i]; };
    std::size_t widest = columns_.size();
    for (const std::size_t i : shown) {
      if (can_shrink(i) && (widest == columns_.size() || widths[i] > widths[widest])) widest = i;
    }
    if (widest == columns_.size()) return false;
    --widths[widest];
    return true;
  };
  while (excess() > 0 && cut_widest_text()) {
  }
  while (excess() > 0 && shown.size() > 1) {
    const auto importance = [&](std::size_t a, std::size_t b) {
      return columns_[a].importance < columns_[b].importance;
    };
    // Of equally important columns the last one goes. min_element finds the first, and therefore searches backwards.
    shown.erase(std::prev(std::min_element(shown.rbegin(), shown.rend(), importance).base()));
  }
  return widths;
}

std::string Table::render(std::size_t width, bool colour) const {
  std::vector<std::size_t> shown(columns_.size());
  std::iota(shown.begin(), shown.end(), std::size_t{0});
  const std::vector<std::size_t> widths = fit(width, shown);

  std::string text;
  const auto add_line = [&](const auto &cell_of) {
    std::string line;
    for (const std::size_t i : shown) {
      const Cell cell = cell_of(i);
      // The last column is not padded: without colour, lines have no trailing blanks.
      const bool last = i == shown.back() && !columns_[i].number;
      const std::string content = cut(cell.text, widths[i]);
      if (i != shown.front()) line.append(kGap, ' ');
      line += tinted(last ? content : padded(content, widths[i], columns_[i].number), cell.tint, colour);
    }
    text += line + "\n";
  };
  add_line([&](std::size_t i) { return Cell{columns_[i].title, Tint::Strong}; });
  for (const auto &row : rows_) {
    add_line([&](std::size_t i) { return row[i]; });
  }
  if (shown.size() < columns_.size()) {
    std::string hidden;
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      if (std::find(shown.begin(), shown.end(), i) == shown.end())
        hidden += (hidden.empty() ? "" : ", ") + columns_[i].title;
    }
    text += tinted(fmt::format("(no room for: {})", hidden), Tint::Faint, colour) + "\n";
  }
  return text;
}

}  // namespace redag
