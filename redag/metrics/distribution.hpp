// A set of durations in few numbers. Percentiles are exact: nearest rank, i.e. the p-th percentile of n sorted values
// is the ceil(p n / 100)-th, always one of the values. Pure functions.
#pragma once

#include <cstdint>
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

  friend bool operator==(const Distribution &, const Distribution &) = default;
};

/// The nearest-rank percentile of sorted values, 0 < percent <= 100. Requires a value.
[[nodiscard]] Duration percentile(const std::vector<Duration> &sorted, double percent);

/// O(n log n).
[[nodiscard]] Distribution distribution_of(std::vector<Duration> values);

}  // namespace redag::metrics
