// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What figures show of many durations: a distribution function in few points, and lateness in equal classes. Pure
// functions; errors: none.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::report {

/// So many of the values are at most `value`.
struct CurvePoint {
  Duration value = 0;
  std::uint64_t count = 0;

  friend bool operator==(const CurvePoint &, const CurvePoint &) = default;
};

/// The empirical distribution of sorted values: exact at each point, with the smallest and the largest among them, and
/// with points as dense towards the largest as percentiles of 90, 99, 99.9 % ... ask for. At most about 60 points and
/// 20 for each power of ten.
[[nodiscard]] std::vector<CurvePoint> curve_of(const std::vector<Duration> &sorted);

/// Lateness L = f - (r + D) as a share of D: -1 at the release, 0 at the deadline. Classes of equal width on [-1, 1),
/// and one for what is beyond. Common to all tasks and executors, so that they can be laid over each other.
struct LatenessHistogram {
  static constexpr std::size_t kClasses = 80;
  std::array<std::uint64_t, kClasses + 1> counts{};

  /// Requires deadline > 0. A job that is exactly at its deadline is not late: it counts below 0.
  void add(Duration lateness, Duration deadline);
  void add(const LatenessHistogram &other);
};

}  // namespace redag::report
