// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/hyperperiod_warning.hpp"

#include <algorithm>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "redag/base/int128.hpp"

namespace redag {
namespace {

// A simulation of an hour takes minutes. No default length comes near it.
constexpr Duration kLongest = 3600 * kSecond;

/// Returns what round periods of this length are multiples of: two digits, and whole milliseconds of longer ones.
Duration round_step_of(Duration period) {
  Duration step = 1;
  while (step < kMillisecond && step <= period / 100) step *= 10;
  return step;
}

Duration nearest_round(Duration period) {
  const Duration step = round_step_of(period);
  return (period + step / 2) / step * step;
}

std::optional<Duration> least_common_multiple(const std::vector<Duration> &periods) {
  Int128 result = 1;
  for (const Duration period : periods) {
    result = result / std::gcd(static_cast<Duration>(result), period) * period;
    if (result > kMaxDuration) return std::nullopt;
  }
  return static_cast<Duration>(result);
}

}  // namespace

std::string hyperperiod_text(std::optional<Duration> hyperperiod) {
  if (!hyperperiod) return "longer than 146 years";
  return *hyperperiod < 3600 * kSecond ? format_duration(*hyperperiod) : humanize_duration(*hyperperiod);
}

std::optional<Duration> rounded_rate(Duration period) {
  constexpr Duration kMost = 1000;
  if (period <= 0) return std::nullopt;
  const Duration rate = (kSecond + period / 2) / period;
  if (rate < 1 || rate > kMost || kSecond % rate == 0 || (kSecond + rate / 2) / rate != period) return std::nullopt;
  return rate;
}

std::optional<Finding> hyperperiod_warning(const Workload &workload,
                                           const std::function<bool(const TaskRef &)> &is_meant) {
  const auto is_round = [](Duration period) { return period % round_step_of(period) == 0; };
  std::vector<Duration> kept;
  std::vector<Duration> odd;
  std::optional<TaskRef> first;
  for (const TaskRef &ref : flatten(workload)) {
    if (ref.task->activation != Activation::Timer) continue;
    const Duration period = ref.task->period;
    if (period <= 0 || period > kMaxDuration) return std::nullopt;
    const bool is_odd = !is_round(period) && !is_meant(ref);
    (is_odd ? odd : kept).push_back(period);
    if (is_odd && !first) first = ref;
  }
  if (!first) return std::nullopt;
  for (std::vector<Duration> *periods : {&kept, &odd}) {
    std::sort(periods->begin(), periods->end());
    periods->erase(std::unique(periods->begin(), periods->end()), periods->end());
  }
  const auto hyperperiod_with = [&](const auto &change) {
    std::vector<Duration> periods = kept;
    for (const Duration period : odd) periods.push_back(change(period));
    return least_common_multiple(periods);
  };
  const std::optional<Duration> now = hyperperiod_with([](Duration period) { return period; });
  if (now && *now <= kLongest) return std::nullopt;

  const Duration period = first->task->period;
  const Duration step = round_step_of(period);
  std::string hint;
  for (const Duration round : {period / step * step, period / step * step + step}) {
    const auto then = hyperperiod_with([&](Duration one) { return one == period ? round : nearest_round(one); });
    if (!then || *then > kLongest) continue;
    hint += fmt::format("{}{} makes it {}", hint.empty() ? "" : ", ", format_duration(round), humanize_duration(*then));
  }
  if (hint.empty()) return std::nullopt;
  const std::size_t others = odd.size() - 1;
  if (others > 0) hint += others == 1 ? " if the other is rounded as well" : " if the others are rounded as well";
  if (const auto rate = rounded_rate(period)) hint += fmt::format("; 'rate: {}Hz' says that it is meant", *rate);
  Finding finding;
  finding.severity = Severity::Warning;
  finding.dag = first->dag;
  finding.task = first->index;
  finding.field = Field::Period;
  finding.involves = Field::Period;
  finding.message =
      fmt::format("period {}{} the hyperperiod {}, too long for a simulation to cover", format_duration(period),
                  others == 0   ? std::string(" makes")
                  : others == 1 ? std::string(" and 1 other make")
                                : fmt::format(" and {} others make", others),
                  hyperperiod_text(now));
  finding.hint = std::move(hint);
  return finding;
}

}  // namespace redag
