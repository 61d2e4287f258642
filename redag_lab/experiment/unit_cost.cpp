// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_cost.hpp"

#include <cmath>
#include <ctime>
#include <numeric>

namespace redag::experiment {

Result<UnitCost> measure_cost(std::uint64_t count, Duration effort, const Evaluate &evaluate,
                              const std::function<Time()> &clock, const std::atomic<bool> &stop) {
  // Steps of the golden ratio leave no gap between the units, however many there are. The step divides no part of the
  // plan: no unit comes twice.
  auto step = static_cast<std::uint64_t>(static_cast<double>(count) * 0.6180339887498949) | 1U;
  while (std::gcd(step, count) != 1) ++step;
  UnitCost cost;
  double squares = 0;  // of the distances from the mean (Welford)
  const Time begin = clock();
  Time last = begin;
  for (std::uint64_t unit = 0; cost.measured < count && last - begin < effort && !stop.load();
       unit = unit < count - step % count ? unit + step % count : unit - (count - step % count)) {
    const Result<std::string> result = evaluate(unit);
    if (!result) return tl::unexpected<Diagnostics>(result.error());
    const Time now = clock();
    ++cost.measured;
    const double distance = static_cast<double>(now - last) - cost.mean;
    cost.mean += distance / static_cast<double>(cost.measured);
    squares += distance * (static_cast<double>(now - last) - cost.mean);
    last = now;
  }
  if (cost.measured > 1) {
    const auto n = static_cast<double>(cost.measured);
    cost.error = 1.96 * std::sqrt(squares / (n - 1) / n);
  }
  return cost;
}

Time thread_time() {
  timespec time{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

}  // namespace redag::experiment
