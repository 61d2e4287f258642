// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces many durations for figures: a distribution function in few points, and lateness in equal classes. Pure
// functions, which never fail.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "redag/base/time.hpp"
#include "redag_analysis/metrics/duration_sketch.hpp"

namespace redag::report {

/// A point of a distribution: `count` of the values are at most `value`.
struct CurvePoint {
  Duration value = 0;
  std::uint64_t count = 0;

  friend bool operator==(const CurvePoint &, const CurvePoint &) = default;
};

/// Returns the empirical distribution of sorted values, exact at each point and with both extremes. Points grow dense
/// towards the largest value, as the percentiles 90, 99, 99.9 % ... require. There are at most about 60 points and 20
/// for each power of ten.
[[nodiscard]] std::vector<CurvePoint> curve_of(const std::vector<Duration> &sorted);
/// The same of the values of a sketch. Of one that is not exact, points are the upper ends of its buckets.
[[nodiscard]] std::vector<CurvePoint> curve_of(const metrics::DurationSketch &values);

/// Counts lateness L = f - (r + D) as a share of D: -1 at the release, 0 at the deadline. Classes have equal width on
/// [-1, 1), and the last one counts all larger values. All tasks and executors share the classes and can be overlaid.
struct LatenessHistogram {
  static constexpr std::size_t kClasses = 80;
  std::array<std::uint64_t, kClasses + 1> counts{};

  /// Requires deadline > 0. A job that finishes exactly at its deadline is not late and counts below 0.
  void add(Duration lateness, Duration deadline);
  void add(const LatenessHistogram &other);
};

}  // namespace redag::report
