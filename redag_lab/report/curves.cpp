// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/curves.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/int128.hpp"

namespace redag::report {
namespace {

constexpr std::uint64_t kBodyPoints = 60;  // evenly over the first nine tenths
constexpr double kPointsPerDecade = 20;    // of the remaining share

// Thins out `all`, which has each different value with the number of values up to it.
std::vector<CurvePoint> thinned(const std::vector<CurvePoint> &all) {
  std::vector<CurvePoint> points;
  if (all.empty()) return points;
  const std::uint64_t n = all.back().count;
  std::vector<std::uint64_t> ranks = {1, n};
  for (std::uint64_t i = 1; i <= kBodyPoints; ++i)
    ranks.push_back(std::max<std::uint64_t>(1, n * 9 * i / (10 * kBodyPoints)));
  for (double i = 0;; ++i) {
    const double above = 0.1 * std::pow(10.0, -i / kPointsPerDecade) * static_cast<double>(n);
    if (above < 1) break;
    ranks.push_back(n - static_cast<std::uint64_t>(above));
  }
  std::sort(ranks.begin(), ranks.end());
  auto point = all.begin();
  for (const std::uint64_t rank : ranks) {
    while (point->count < rank) ++point;
    if (rank > 0 && (points.empty() || points.back() != *point)) points.push_back(*point);
  }
  return points;
}

}  // namespace

std::vector<CurvePoint> curve_of(const std::vector<Duration> &sorted) {
  std::vector<CurvePoint> all;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    if (i + 1 == sorted.size() || sorted[i + 1] != sorted[i]) all.push_back({sorted[i], i + 1});
  }
  return thinned(all);
}

std::vector<CurvePoint> curve_of(const metrics::DurationSketch &values) {
  std::vector<CurvePoint> all;
  std::uint64_t count = 0;
  for (const metrics::CountedDurations &some : values.counted()) {
    if (all.empty() && some.low < some.high) all.push_back({some.low, 1});  // the smallest value is known exactly
    count += some.count;
    all.push_back({some.high, count});
  }
  return thinned(all);
}

void LatenessHistogram::add(Duration lateness, Duration deadline) {
  constexpr Int128 kHalf = kClasses / 2;
  // Computes (L / D + 1) * half, rounded so that L = 0 falls into the class below 0.
  const Int128 scaled = (static_cast<Int128>(lateness) + deadline) * kHalf;
  const Int128 index = scaled <= 0 ? 0 : (scaled - 1) / deadline;
  ++counts[static_cast<std::size_t>(std::min<Int128>(index, kClasses))];
}

void LatenessHistogram::add(const LatenessHistogram &other) {
  for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += other.counts[i];
}

}  // namespace redag::report
