// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws lines with confidence bands, in panels side by side, as one self-contained SVG. It serves the shares that
// experiments measure. Pure.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace redag::experiment {

struct LinePlot {
  struct Value {
    double x = 0;
    double y = 0;
    double low = 0;  // of the band
    double high = 0;
  };
  struct Panel {
    std::string title;
    std::vector<std::vector<Value>> series;  // by line; empty if a line has no values here
    std::string x_label;                     // replaces the plot's
    /// Positions on the x axis with their labels; the axis ends at the last. Empty: fifths of the axis.
    std::vector<std::pair<double, std::string>> ticks;
  };

  std::string title;
  std::string subtitle;
  std::string x_label;
  std::string y_label;
  std::vector<std::string> lines;  // names for the legend; a line has the same style in all panels
  std::vector<Panel> panels;
  double y_end = 1;
};

/// Draws the plot. y runs from 0 to y_end, x from 0 to the last tick or the largest value (at least 1). The legend
/// marks lines without any value.
[[nodiscard]] std::string to_svg(const LinePlot &plot);

}  // namespace redag::experiment
