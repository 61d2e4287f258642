// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A line on standard error with the progress of a long command, on a terminal only. It is redrawn at most ten times a
// second and finally erased. Not thread-safe.
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

  /// Sets the text before the bar, such as "mte 2/3".
  void set_label(std::string label) { label_ = std::move(label); }

  /// True on a terminal, if it is time to redraw. Reads a clock, but is cheap enough to call often.
  [[nodiscard]] bool due() const;

  /// Draws the line. `done` is in [0, 1]; `detail` follows the bar, cut to the terminal.
  void draw(double done, std::string_view detail);

  /// Returns the estimated remaining time at the pace so far, such as ", 12s left"; empty while the estimate is too
  /// uncertain.
  [[nodiscard]] std::string left(double done) const;

  /// Erases the line before other text is written.
  void clear();

 private:
  Console &console_;
  std::string label_;
  Time begin_;
  Time last_drawn_ = 0;
  bool visible_ = false;
};

/// Measures the time since its construction.
class Stopwatch {
 public:
  Stopwatch();
  [[nodiscard]] Duration elapsed() const;

 private:
  Time begin_;
};

/// Returns "3 200 of 8 000, 512/s, 9.4s left" for `done` of `total`, `elapsed` after the start.
[[nodiscard]] std::string pace(std::uint64_t done, std::uint64_t total, Duration elapsed);

/// Returns "label [#####     ]  50 %  detail", at most `width` columns.
[[nodiscard]] std::string progress_line(std::string_view label, double done, std::string_view detail,
                                        std::size_t width);

}  // namespace redag::cli
