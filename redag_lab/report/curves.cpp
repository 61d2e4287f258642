// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/curves.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/int128.hpp"

namespace redag::report {
namespace {

constexpr std::size_t kBodyPoints = 60;  // evenly over the first nine tenths
constexpr double kPointsPerDecade = 20;  // of the remaining share

}  // namespace

std::vector<CurvePoint> curve_of(const std::vector<Duration> &sorted) {
  std::vector<CurvePoint> points;
  if (sorted.empty()) return points;
  const std::size_t n = sorted.size();
  std::vector<std::size_t> ranks = {1, n};
  for (std::size_t i = 1; i <= kBodyPoints; ++i)
    ranks.push_back(std::max<std::size_t>(1, n * 9 * i / (10 * kBodyPoints)));
  for (double i = 0;; ++i) {
    const double above = 0.1 * std::pow(10.0, -i / kPointsPerDecade) * static_cast<double>(n);
    if (above < 1) break;
    ranks.push_back(n - static_cast<std::size_t>(above));
  }
  std::sort(ranks.begin(), ranks.end());
  for (const std::size_t rank : ranks) {
    if (rank == 0) continue;
    const Duration value = sorted[rank - 1];
    // The count includes all values equal to this one.
    const auto above = std::upper_bound(sorted.begin() + static_cast<std::ptrdiff_t>(rank - 1), sorted.end(), value);
    const CurvePoint point{value, static_cast<std::uint64_t>(above - sorted.begin())};
    if (points.empty() || points.back() != point) points.push_back(point);
  }
  return points;
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
