// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A line on standard error with the progress of a long command, on a terminal only. It is redrawn at most ten times a
// second and finally erased. Not thread-safe.
#pragma once

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

  /// Returns the time since the construction.
  [[nodiscard]] Duration elapsed() const;

  /// Erases the line before other text is written.
  void clear();

 private:
  Console &console_;
  std::string label_;
  Time begin_;
  Time last_drawn_ = 0;
  bool visible_ = false;
};

/// Returns "label [#####     ]  50 %  detail", at most `width` columns.
[[nodiscard]] std::string progress_line(std::string_view label, double done, std::string_view detail,
                                        std::size_t width);

}  // namespace redag::cli
