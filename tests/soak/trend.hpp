// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Does a series of samples grow? Values only.
#pragma once

#include <string>
#include <vector>

namespace redag::soak {

struct Series {
  std::string name;            // with its unit
  double allowed_growth = 0;   // from the first sample to the last
  std::vector<double> values;  // at equal distances
};

struct Trend {
  double first = 0;
  double last = 0;
  double growth = 0;  // of the line through all samples, from the first to the last
};

/// The line has the median of the slopes of all pairs (Theil and Sen): a few samples that a busy machine spoilt do not
/// bend it. Less than two samples do not grow.
[[nodiscard]] Trend trend_of(const std::vector<double> &values);

}  // namespace redag::soak
