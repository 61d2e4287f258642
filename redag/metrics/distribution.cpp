#include "redag/metrics/distribution.hpp"

#include <algorithm>
#include <cmath>

#include "redag/base/check.hpp"

namespace redag::metrics {

std::uint64_t nearest_rank(double percent, std::uint64_t count) {
  REDAG_CHECK(count > 0 && percent > 0 && percent <= 100, "a percentile needs values and a rank");
  // 1e-9: 95 % of 20 is 19, although 95.0 / 100.0 * 20 may come out a little above.
  const double rank = std::ceil(percent * static_cast<double>(count) / 100.0 - 1e-9);
  return std::min(static_cast<std::uint64_t>(std::max(1.0, rank)), count);
}

Duration percentile(const std::vector<Duration> &sorted, double percent) {
  return sorted[static_cast<std::size_t>(nearest_rank(percent, sorted.size())) - 1];
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
