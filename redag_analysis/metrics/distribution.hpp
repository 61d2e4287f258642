// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A set of durations in a few numbers. Percentiles are nearest rank: the p-th percentile of n sorted values is the
// ceil(p n / 100)-th, always one of the values. Here they are exact; duration_sketch.hpp takes more values than memory
// should hold. Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::metrics {

/// All durations in ns; zeros where count is 0.
struct Distribution {
  std::uint64_t count = 0;
  double mean = 0;
  Duration min = 0;
  Duration p50 = 0;
  Duration p90 = 0;
  Duration p95 = 0;
  Duration p99 = 0;
  Duration max = 0;
  double percentile_error = 0;  // relative error of the percentiles alone; 0: exact

  friend bool operator==(const Distribution &, const Distribution &) = default;
};

/// The rank of a percentile among `count` values, from 1 on. Requires count > 0 and 0 < percent <= 100.
[[nodiscard]] std::uint64_t nearest_rank(double percent, std::uint64_t count);

/// The nearest-rank percentile of sorted values, 0 < percent <= 100. Requires at least one value.
[[nodiscard]] Duration percentile(const std::vector<Duration> &sorted, double percent);

/// Returns the worst of several distributions, figure by figure: the largest mean, percentiles and maximum, and the
/// least minimum; `count` is that of all together. No figure mixes values: each is that of one distribution.
/// Distributions without values are ignored.
[[nodiscard]] Distribution worst_of(std::span<const Distribution> all);

/// Summarises the values. O(n log n).
[[nodiscard]] Distribution distribution_of(std::vector<Duration> values);

}  // namespace redag::metrics
