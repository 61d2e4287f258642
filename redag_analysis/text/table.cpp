// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "redag/base/check.hpp"
#include "redag_analysis/text/wrap.hpp"

namespace redag {
namespace {

constexpr std::size_t kGap = 2;          // between columns
constexpr std::size_t kLeastProse = 24;  // prose does not wrap below this, nor below its longest word
constexpr std::size_t kShortestCut = 8;  // a name is not cut below this

std::size_t longest_word(const std::string &text) {
  std::size_t longest = 0;
  for (const std::string &word : lines_within(text, 1)) longest = std::max(longest, display_width(word));
  return longest;
}

}  // namespace

// Chooses the columns to show, and their widths.
class Table::Layout {
 public:
  Layout(const Table &table, std::size_t width)
      : columns_(table.columns_), rows_(table.rows_), width_(width), shown_(columns_.size()) {
    std::iota(shown_.begin(), shown_.end(), std::size_t{0});
    measure();
    narrow(
        [this](std::size_t i) { return columns_[i].prose ? std::max(widest(i, longest_word), kLeastProse) : kWhole; });
    // The most important number stays, because names alone tell nothing.
    leave_out([this](std::size_t i) { return !is_name(i); }, 1);
    narrow([this](std::size_t i) { return columns_[i].number || columns_[i].prose ? kWhole : kShortestCut; });
    if (!is_too_wide()) return;
    // Cut names do not help: the last column shows as much as fits.
    leave_out([](std::size_t) { return true; }, 1);
    measure();
    narrow([](std::size_t) { return std::size_t{1}; });
  }

  [[nodiscard]] const std::vector<std::size_t> &shown() const { return shown_; }
  [[nodiscard]] std::size_t width_of(std::size_t column) const { return widths_[column]; }
  [[nodiscard]] bool shows(std::size_t column) const {
    return std::find(shown_.begin(), shown_.end(), column) != shown_.end();
  }

 private:
  static constexpr auto kWhole = static_cast<std::size_t>(-1);

  [[nodiscard]] bool is_name(std::size_t column) const {
    const auto is_above = [&](const Column &other) {
      return other.number && other.importance > columns_[column].importance;
    };
    return !columns_[column].number && std::none_of(columns_.begin(), columns_.end(), is_above);
  }

  [[nodiscard]] bool is_too_wide() const {
    std::size_t total = kGap * (shown_.size() - 1);
    for (const std::size_t i : shown_) total += widths_[i];
    return width_ > 0 && total > width_;
  }

  void measure() {
    widths_.clear();
    for (std::size_t i = 0; i < columns_.size(); ++i) widths_.push_back(widest(i, display_width));
  }

  template <class Width>
  [[nodiscard]] std::size_t widest(std::size_t column, Width width) const {
    std::size_t most = width(columns_[column].title);
    for (const auto &row : rows_) most = std::max(most, width(row[column].text));
    return most;
  }

  // Takes columns from the widest one, as many as needed, down to the least width of each.
  template <class Least>
  void narrow(Least least_of) {
    if (!is_too_wide()) return;
    std::vector<std::size_t> least;
    for (std::size_t i = 0; i < columns_.size(); ++i) least.push_back(least_of(i));
    while (is_too_wide()) {
      const auto room = [&](std::size_t i) { return widths_[i] > least[i] ? widths_[i] : 0; };
      const auto next = std::max_element(shown_.begin(), shown_.end(),
                                         [&](std::size_t a, std::size_t b) { return room(a) < room(b); });
      if (room(*next) == 0) return;
      --widths_[*next];
    }
  }

  // Leaves out columns that may go, the least important first, and keeps the last `kept` of them.
  template <class MayGo>
  void leave_out(MayGo may_go, std::ptrdiff_t kept) {
    while (is_too_wide() && std::count_if(shown_.begin(), shown_.end(), may_go) > kept) {
      const auto rank = [&](std::size_t i) { return std::pair(!may_go(i), columns_[i].importance); };
      // Of equally important columns the last one goes. min_element finds the first, and therefore searches backwards.
      const auto least = std::min_element(shown_.rbegin(), shown_.rend(),
                                          [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
      shown_.erase(std::prev(least.base()));
    }
  }

  const std::vector<Column> &columns_;
  const std::vector<std::vector<Cell>> &rows_;
  std::size_t width_;
  std::vector<std::size_t> shown_;
  std::vector<std::size_t> widths_;
};

void Table::add(std::vector<Cell> row) {
  REDAG_CHECK(row.size() <= columns_.size(), "a row has more cells than the table has columns");
  row.resize(columns_.size());
  rows_.push_back(std::move(row));
}

std::vector<std::string> Table::lines(const Layout &layout, bool colour) const {
  std::vector<std::string> text;
  const auto add_row = [&](const auto &cell_of) {
    std::vector<std::vector<std::string>> cells(columns_.size());
    std::size_t height = 1;
    for (const std::size_t i : layout.shown()) {
      const Cell cell = cell_of(i);
      cells[i] = columns_[i].prose ? lines_within(cell.text, layout.width_of(i)) : std::vector{cell.text};
      height = std::max(height, cells[i].size());
    }
    for (std::size_t k = 0; k < height; ++k) {
      std::string line;
      std::size_t blank = 0;  // columns before the next text: without colour, lines have no trailing blanks
      for (const std::size_t i : layout.shown()) {
        const std::string content = k < cells[i].size() ? cut(cells[i][k], layout.width_of(i)) : std::string();
        const std::size_t space = layout.width_of(i) - display_width(content);
        if (columns_[i].number) blank += space;
        if (!content.empty()) {
          line += std::string(blank, ' ') + tinted(content, cell_of(i).tint, colour);
          blank = 0;
        }
        blank += kGap + (columns_[i].number ? 0 : space);
      }
      text.push_back(std::move(line));
    }
  };
  add_row([&](std::size_t i) { return Cell{columns_[i].title, Tint::Strong}; });
  for (const auto &row : rows_) add_row([&](std::size_t i) { return row[i]; });
  return text;
}

std::vector<std::string> Table::lines(std::size_t width, bool colour) const {
  return lines(Layout(*this, width), colour);
}

std::string Table::render(std::size_t width, bool colour) const {
  const Layout layout(*this, width);
  std::string text;
  for (const std::string &line : lines(layout, colour)) text += line + "\n";
  std::string hidden;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    if (!layout.shows(i)) hidden += (hidden.empty() ? "" : ", ") + columns_[i].title;
  }
  if (!hidden.empty())
    text += tinted(fitted(fmt::format("(no room for: {})", hidden), width), Tint::Faint, colour) + "\n";
  return text;
}

}  // namespace redag
