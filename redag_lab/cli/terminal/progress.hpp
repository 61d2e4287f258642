// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A line on standard error that tells how far a long command is. On a terminal it is redrawn at most ten times a second
// and erased when done; elsewhere a plain line comes every five seconds. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/time.hpp"
#include "redag_lab/cli/terminal/console.hpp"

namespace redag::cli {

class Progress {
 public:
  explicit Progress(Console &console);
  ~Progress() { clear(); }
  Progress(const Progress &) = delete;
  Progress &operator=(const Progress &) = delete;

  /// What stands before the bar: "mte 2/3".
  void set_label(std::string label) { label_ = std::move(label); }

  /// Is it time to redraw? Cheap enough to ask often, but reads a clock.
  [[nodiscard]] bool due() const;

  /// `done` in [0, 1]; `detail` stands after the bar, cut to the terminal.
  void draw(double done, std::string_view detail);

  /// ", 12s left": how long it will take from here on if it goes on as it did; empty while that is a mere guess.
  [[nodiscard]] std::string left(double done) const;

  /// Takes the line away, so that other text can be written.
  void clear();

 private:
  Console &console_;
  std::string label_;
  Time begin_;
  Time last_drawn_;
  bool visible_ = false;
};

/// Time since it was made.
class Stopwatch {
 public:
  Stopwatch();
  [[nodiscard]] Duration elapsed() const;

 private:
  Time begin_;
};

/// "3 200 of 8 000, 512/s, 9.4s left": how `done` of `total` went, `elapsed` after the first of them began.
[[nodiscard]] std::string pace(std::uint64_t done, std::uint64_t total, Duration elapsed);

/// "label [#####     ]  50 %  detail", at most `width` columns.
[[nodiscard]] std::string progress_line(std::string_view label, double done, std::string_view detail,
                                        std::size_t width);

}  // namespace redag::cli
