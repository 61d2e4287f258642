// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/distribution.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/check.hpp"

namespace redag::metrics {

std::uint64_t nearest_rank(double percent, std::uint64_t count) {
  REDAG_CHECK(count > 0 && percent > 0 && percent <= 100, "a percentile needs values and a rank");
  // 1e-9 absorbs rounding: 95 % of 20 is 19, although 95.0 / 100.0 * 20 may come out slightly larger.
  const double rank = std::ceil(percent * static_cast<double>(count) / 100.0 - 1e-9);
  return std::min(static_cast<std::uint64_t>(std::max(1.0, rank)), count);
}

Duration percentile(const std::vector<Duration> &sorted, double percent) {
  return sorted[static_cast<std::size_t>(nearest_rank(percent, sorted.size())) - 1];
}

Distribution worst_of(std::span<const Distribution> all) {
  Distribution worst;
  for (const Distribution &one : all) {
    if (one.count == 0) continue;
    worst.min = worst.count == 0 ? one.min : std::min(worst.min, one.min);
    worst.mean = worst.count == 0 ? one.mean : std::max(worst.mean, one.mean);
    const auto largest = [&](Duration Distribution::*figure) {
      worst.*figure = worst.count == 0 ? one.*figure : std::max(worst.*figure, one.*figure);
    };
    largest(&Distribution::p50);
    largest(&Distribution::p90);
    largest(&Distribution::p95);
    largest(&Distribution::p99);
    largest(&Distribution::max);
    worst.percentile_error = std::max(worst.percentile_error, one.percentile_error);
    worst.count += one.count;
  }
  return worst;
}

Distribution distribution_of(std::vector<Duration> values) {
  Distribution result;
  result.count = values.size();
  if (values.empty()) return result;
  std::sort(values.begin(), values.end());
  double sum = 0;
  for (const Duration value : values) sum += static_cast<double>(value);
  result.mean = sum / static_cast<double>(values.size());
  result.min = values.front();
  result.p50 = percentile(values, 50);
  result.p90 = percentile(values, 90);
  result.p95 = percentile(values, 95);
  result.p99 = percentile(values, 99);
  result.max = values.back();
  return result;
}

}  // namespace redag::metrics
