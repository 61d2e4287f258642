// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/curves.hpp"

#include <algorithm>
#include <cmath>

namespace redag::report {
namespace {

constexpr std::uint64_t kBodyPoints = 60;  // evenly over the first nine tenths
constexpr double kPointsPerDecade = 20;    // of the remaining share

// Returns which of `n` sorted values are points, counted from 1.
std::vector<std::uint64_t> ranks_of(std::uint64_t n) {
  std::vector<std::uint64_t> ranks = {1, n};
  for (std::uint64_t i = 1; i <= kBodyPoints; ++i) {
    ranks.push_back(std::max<std::uint64_t>(1, n * 9 * i / (10 * kBodyPoints)));
  }
  for (double i = 0;; ++i) {
    const double above = 0.1 * std::pow(10.0, -i / kPointsPerDecade) * static_cast<double>(n);
    if (above < 1) break;
    ranks.push_back(n - static_cast<std::uint64_t>(above));
  }
  std::sort(ranks.begin(), ranks.end());
  return ranks;
}

}  // namespace

std::vector<CurvePoint> curve_of(const metrics::DurationSketch &values) {
  std::vector<CurvePoint> all;
  std::uint64_t count = 0;
  for (const metrics::CountedDurations &some : values.counted()) {
    if (all.empty() && some.low < some.high) all.push_back({some.low, 1});  // the smallest value is known exactly
    count += some.count;
    all.push_back({some.high, count});
  }
  std::vector<CurvePoint> points;
  if (all.empty()) return points;
  auto point = all.begin();
  for (const std::uint64_t rank : ranks_of(count)) {
    while (point->count < rank) ++point;
    if (points.empty() || points.back() != *point) points.push_back(*point);
  }
  return points;
}

}  // namespace redag::report
