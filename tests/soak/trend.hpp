// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Decides whether a series of samples grows. Values only.
#pragma once

#include <string>
#include <vector>

namespace redag::soak {

struct Series {
  std::string name;            // includes its unit
  double allowed_growth = 0;   // from the first sample to the last
  std::vector<double> values;  // sampled at equal distances
};

struct Trend {
  double first = 0;
  double last = 0;
  double growth = 0;  // growth of the fitted line, from the first sample to the last
};

/// Fits a line with the median slope of all pairs (Theil and Sen): a few samples disturbed by a busy machine do not
/// bend it. Fewer than two samples do not grow.
[[nodiscard]] Trend trend_of(const std::vector<double> &values);

}  // namespace redag::soak
