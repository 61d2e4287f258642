// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/curves.hpp"

#include <algorithm>

namespace redag::report {

std::vector<CurvePoint> curve_of(const metrics::DurationSketch &values) {
  const std::uint64_t n = values.size();
  std::vector<CurvePoint> points;
  std::uint64_t count = 0;
  std::uint64_t next = 1;  // the count from which on the next point is due
  for (const metrics::CountedDurations &some : values.counted()) {
    if (points.empty() && some.low < some.high) points.push_back({some.low, 1});  // the smallest value is known exactly
    count += some.count;
    if (count < next) continue;
    points.push_back({some.high, count});
    // 60 points over all values, and 20 for each power of ten of those that remain.
    next = count + std::clamp<std::uint64_t>((n - count) / 9, 1, std::max<std::uint64_t>(1, n / 60));
  }
  return points;
}

}  // namespace redag::report
