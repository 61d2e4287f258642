// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Graphs of one line: a bar, a histogram of response times, their course over the last looks. Values and pure
// functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <string>

#include "redag/live/frame.hpp"
#include "redag_lab/cli/terminal/styled.hpp"

namespace redag::cli {

/// The characters of graphs.
struct Glyphs {
  bool ascii = false;  // for terminals that show no block elements

  /// A column of height 0 (blank) to 8.
  [[nodiscard]] const char *column(std::size_t height) const;
  [[nodiscard]] const char *bar() const { return ascii ? "|" : "\u2588"; }
};

/// Returns "[███     37.2 %]" in `width` columns; a share above 1 fills it. Requires a width of at least 12.
[[nodiscard]] Line share_bar(double share, std::size_t width, const Glyphs &glyphs);

/// A range of classes of time (live::page::least_in), which the histograms of all rows share.
struct TimeAxis {
  std::size_t first = 0;
  std::size_t last = 0;  // not included; first == last: no row has a response time

  [[nodiscard]] bool is_empty() const { return first == last; }
  /// The classes of a graph's column: [class_of(column), class_of(column + 1)).
  [[nodiscard]] std::size_t class_of(std::size_t column, std::size_t width) const;
};

/// Returns the classes that occur in a frame since the start.
[[nodiscard]] TimeAxis axis_of(const live::Frame &frame);

/// Returns the axis in words, "12us      3ms", in `width` columns.
[[nodiscard]] std::string axis_text(const TimeAxis &axis, std::size_t width);

/// Returns a histogram in `width` columns. What is beyond `deadline` (0: none) is Bad.
[[nodiscard]] Line histogram(const std::uint32_t (&counts)[live::page::kClasses], const TimeAxis &axis,
                             Duration deadline, std::size_t width, const Glyphs &glyphs);

/// The recent p99 of each row at the last looks.
class Course {
 public:
  static constexpr std::size_t kLooks = 120;

  /// Adds a look; a frame that was already added changes nothing. Forgets rows that are gone.
  void add(const live::Frame &frame);
  void clear();

  /// Returns the last `width` looks at a row; the full height is `deadline`, or the largest value if there is none or
  /// if it is larger. Looks beyond the deadline are Bad.
  [[nodiscard]] Line graph(const std::string &name, Duration deadline, std::size_t width, const Glyphs &glyphs) const;

 private:
  std::map<std::string, std::deque<Duration>> values_;
  std::uint64_t sequence_ = 0;
};

}  // namespace redag::cli
