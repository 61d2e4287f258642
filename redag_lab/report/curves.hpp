// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces many durations to a distribution function in few points. Pure function.
#pragma once

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

/// Returns the empirical distribution, exact at each point and with both extremes; of a sketch that is not exact,
/// points are the upper ends of its buckets. Points grow dense towards the largest value, as the percentiles 90,
/// 99, 99.9 % ... require. There are at most about 60 points and 20 for each power of ten.
[[nodiscard]] std::vector<CurvePoint> curve_of(const metrics::DurationSketch &values);

}  // namespace redag::report
