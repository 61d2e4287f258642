// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "redag/base/check.hpp"
#include "redag_lab/import/model.hpp"
#include "redag_lab/import/units.hpp"

namespace redag::lab {
namespace {

constexpr double kNear = 0.2;         // intervals this near the median are those of a period
constexpr double kMostlyNear = 0.75;  // with this share of them, messages are periodic
constexpr double kRound = 5e-4;       // a measured period is that far from the one that was meant

/// Returns the round period or rate that was probably meant, or the period itself.
Duration round_period(double period) {
  const auto is_near = [&](double candidate) { return std::abs(candidate - period) <= kRound * period; };
  for (const Duration unit : {kMillisecond, 100 * kMicrosecond}) {
    const double candidate = std::round(period / static_cast<double>(unit)) * static_cast<double>(unit);
    if (candidate > 0 && is_near(candidate)) return static_cast<Duration>(candidate);
  }
  const double hertz = std::round(static_cast<double>(kSecond) / period);
  if (hertz > 0 && is_near(static_cast<double>(kSecond) / hertz)) {
    return static_cast<Duration>(std::llround(static_cast<double>(kSecond) / hertz));
  }
  return std::max<Duration>(std::llround(period), 1);
}

/// Fits a grid to the instants by least squares. Messages that did not come leave points of the grid empty. What came
/// late together shares a point, until late ones are known to belong to earlier points.
Arrivals fit_grid(const std::vector<Time> &instants, Duration median) {
  // A phase-locked loop follows the sender: the median is not quite its period.
  constexpr double kFollow = 0.2;
  constexpr double kLearn = 0.02;
  std::vector<double> points;
  auto length = static_cast<double>(median);
  double expected = 0;  // when the last point was due, after the first instant
  for (const Time time : instants) {
    const auto since = static_cast<double>(time - instants.front());
    const double step = std::max(std::round((since - expected) / length), 0.0);
    points.push_back((points.empty() ? 0 : points.back()) + step);
    expected += step * length;
    length += kLearn * (since - expected);
    expected += kFollow * (since - expected);
  }
  const auto count = static_cast<double>(instants.size());
  const double mean_point = std::accumulate(points.begin(), points.end(), 0.0) / count;
  double mean_time = 0;
  for (const Time time : instants) mean_time += static_cast<double>(time - instants.front()) / count;
  double covariance = 0;
  double variance = 0;
  for (std::size_t i = 0; i < instants.size(); ++i) {
    const double point = points[i] - mean_point;
    covariance += point * (static_cast<double>(instants[i] - instants.front()) - mean_time);
    variance += point * point;
  }
  const double period = covariance / variance;
  for (std::size_t i = points.size() - 1; i > 0; --i) points[i - 1] = std::min(points[i - 1], points[i] - 1);
  double earliest = std::numeric_limits<double>::max();
  double latest = std::numeric_limits<double>::lowest();
  for (std::size_t i = 0; i < instants.size(); ++i) {
    const double off = static_cast<double>(instants[i] - instants.front()) - points[i] * period;
    earliest = std::min(earliest, off);
    latest = std::max(latest, off);
  }
  Arrivals arrivals;
  arrivals.period = round_period(period);
  arrivals.jitter = std::min(static_cast<Duration>(latest - earliest), arrivals.period);
  const double missing = points.back() - points.front() + 1 - count;
  if (missing > 0) {
    arrivals.note = fmt::format("{:.0f} of {:.0f} did not come", missing, points.back() - points.front() + 1);
  }
  return arrivals;
}

}  // namespace

Duration most_early(Duration period) { return std::min(period / 10, kMillisecond); }

Time last_expiry(Time grid, Duration period, Time start, Duration early) {
  return std::min(start, start + early - ((start + early - grid) % period + period) % period);
}

Time grid_of(const CallbackRecord &timer) {
  constexpr std::size_t kMostTried = 64;
  constexpr Duration kWakeUp = 200 * kMicrosecond;
  const Duration period = timer.id.period;
  const auto runs = std::span(timer.ended).first(std::min(timer.ended.size(), kMostTried));
  const auto seen = [](const EndedRun &run) { return run.woken.value_or(run.start); };
  // How late runs were though the executor was free. Of a wrong grid they are late without a reason.
  const auto lateness = [&](Time grid, Duration early) {
    Duration sum = 0;
    for (const EndedRun &run : runs) {
      const Time expiry = last_expiry(grid, period, seen(run), early);
      if (run.free) sum += seen(run) - (run.woken ? expiry : std::max(expiry, *run.free));
    }
    return sum;
  };
  if (runs.size() < kFewestRuns) return timer.created;
  Time best = timer.created;
  Duration least = lateness(best, most_early(period)) - kWakeUp * static_cast<Duration>(runs.size());
  for (const EndedRun &run : runs) {
    const Duration sum = lateness(seen(run), 0);
    if (sum >= least) continue;
    least = sum;
    best = seen(run);
  }
  return best;
}

Arrivals estimate_arrivals(std::vector<Time> instants) {
  REDAG_CHECK(instants.size() >= 3, "a rate needs three arrivals");
  std::sort(instants.begin(), instants.end());
  std::vector<Duration> intervals;
  for (std::size_t i = 1; i < instants.size(); ++i) intervals.push_back(instants[i] - instants[i - 1]);
  std::vector<Duration> sorted = intervals;
  std::sort(sorted.begin(), sorted.end());
  const Duration median = sorted[sorted.size() / 2];
  const auto near = std::count_if(sorted.begin(), sorted.end(), [&](Duration interval) {
    return std::abs(static_cast<double>(interval - median)) <= kNear * static_cast<double>(median);
  });
  if (median > 0 && static_cast<double>(near) >= kMostlyNear * static_cast<double>(sorted.size())) {
    return fit_grid(instants, median);
  }
  const double mean = static_cast<double>(instants.back() - instants.front()) / static_cast<double>(intervals.size());
  Arrivals arrivals;
  if (sorted.front() > 0 && static_cast<double>(sorted.front()) >= mean / 4) {
    arrivals.period = sorted.front();
    arrivals.sporadic = true;
    arrivals.note = fmt::format("no period: {} is the shortest distance seen, {} the mean one",
                                humanize_duration(sorted.front()), humanize_duration(static_cast<Duration>(mean)));
    return arrivals;
  }
  // As an event with its shortest distance it would need a multiple of the processor time that it used.
  arrivals.period = std::max<Duration>(std::llround(mean), 1);
  arrivals.jitter = arrivals.period;
  arrivals.note = fmt::format("unknown: it comes in bursts, {} apart at the least; the period is the mean distance",
                              humanize_duration(sorted.front()));
  return arrivals;
}

}  // namespace redag::lab
