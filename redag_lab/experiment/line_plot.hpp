// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lines with confidence bands, in panels beside each other, as one self-contained SVG. For the shares that experiments
// measure; no more than that. Pure.
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
    std::vector<std::vector<Value>> series;  // by line; empty where a line has nothing to say
    std::string x_label;                     // instead of the plot's
    /// Places on the x axis and what stands below them, which then ends at the last; empty: fifths of it.
    std::vector<std::pair<double, std::string>> ticks;
  };

  std::string title;
  std::string subtitle;
  std::string x_label;
  std::string y_label;
  std::vector<std::string> lines;  // names, for the legend; equal styles in all panels
  std::vector<Panel> panels;
  double y_end = 1;
};

/// y runs from 0 to y_end; x from 0 to the largest value (at least 1) or the last tick. Lines without a value anywhere
/// are named as such in the legend.
[[nodiscard]] std::string to_svg(const LinePlot &plot);

}  // namespace redag::experiment
