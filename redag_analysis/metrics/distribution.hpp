// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A set of durations in few numbers. Percentiles are nearest rank, i.e. the p-th percentile of n sorted values is the
// ceil(p n / 100)-th, always one of the values; exact here (duration_sketch.hpp: of more values than memory should
// hold). Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::metrics {

/// All in ns; zeros where count is 0.
struct Distribution {
  std::uint64_t count = 0;
  double mean = 0;
  Duration min = 0;
  Duration p50 = 0;
  Duration p90 = 0;
  Duration p95 = 0;
  Duration p99 = 0;
  Duration max = 0;
  double percentile_error = 0;  // relative, of the percentiles alone; 0: exact

  friend bool operator==(const Distribution &, const Distribution &) = default;
};

/// The rank of a percentile among `count` values, from 1 on. Requires a value and 0 < percent <= 100.
[[nodiscard]] std::uint64_t nearest_rank(double percent, std::uint64_t count);

/// The nearest-rank percentile of sorted values, 0 < percent <= 100. Requires a value.
[[nodiscard]] Duration percentile(const std::vector<Duration> &sorted, double percent);

/// Of several distributions the worst, figure by figure: mean, percentiles and maximum are the largest among them, the
/// minimum is the least, `count` is that of all. Mixes nothing: each figure is that of one of them. Those without
/// values say nothing.
[[nodiscard]] Distribution worst_of(std::span<const Distribution> all);

/// O(n log n).
[[nodiscard]] Distribution distribution_of(std::vector<Duration> values);

}  // namespace redag::metrics
