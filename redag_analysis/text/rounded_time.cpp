// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/rounded_time.hpp"

namespace redag {
namespace {

// The smaller unit that humanize_duration() writes, or that of the fourth significant digit.
Duration step_of(Duration duration) {
  constexpr Duration kMinutes = 60 * kSecond;
  constexpr Duration kHours = 60 * kMinutes;
  if (duration >= 24 * kHours || duration <= -24 * kHours) return kHours;
  if (duration >= kHours || duration <= -kHours) return kMinutes;
  Duration step = 1;
  while (duration / step >= 10'000 || duration / step <= -10'000) step *= 10;
  return step;
}

}  // namespace

std::string humanize_down(Duration duration) {
  const Duration step = step_of(duration);
  const Duration rest = duration % step;
  const Duration down = duration - (rest < 0 ? rest + step : rest);
  return down < 0 ? "-" + humanize_duration(-down) : humanize_duration(down);
}

Duration round_up(Duration duration) {
  const Duration step = step_of(duration);
  const Duration rest = duration % step;
  return rest > 0 ? duration + (step - rest) : duration - rest;
}

std::string humanize_up(Duration duration) {
  if (duration < 0) return "-" + humanize_down(-duration);
  return humanize_duration(round_up(duration));
}

}  // namespace redag
