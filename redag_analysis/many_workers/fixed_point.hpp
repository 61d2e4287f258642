// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Fixed points of the bounds for several workers: of one window, and of responses that rely on each other. Every
// function iterated is monotone: larger windows and larger responses assumed of others never give less.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis::global {

/// Fixed point of a monotone `next`, from a `value` below the least one on. False above `stop`. The last call of `next`
/// was with the `value` found, so that what it leaves behind is of that one. It is the least, unless that takes more
/// than kMaxSteps: then one from farther ahead, by doubling the way and bisection, if there is one where that looks.
template <class Next>
[[nodiscard]] bool least_fixed_point(Duration stop, Duration &value, Next next) {
  const Duration begin = value;
  for (int steps = 0; value <= stop && steps < kMaxSteps; ++steps) {
    const Duration grown = next(value);
    if (grown <= value) return true;
    value = grown;
  }
  // next(value) > value; where it is not, all between holds a fixed point: the first such place after the last other.
  for (Duration ahead = value - begin; value < stop; ahead *= 2) {
    Duration above = ahead < stop - value ? value + ahead : stop;
    if (next(above) > above) {
      value = above;
      continue;
    }
    while (above - value > 1) {
      const Duration middle = value + (above - value) / 2;
      (next(middle) > middle ? value : above) = middle;
    }
    value = above;
    return next(value) == value;
  }
  return false;
}

/// Sets responses (or latest arrivals) that rely on each other to the least that agree: each is what evaluate(k) makes
/// of the others. evaluate(k) sets the k-th value from all of them, and answers false above its limit; it must be
/// monotone. Values start at or below the least that agree. Empty, or why there are none: `exceeds` if one is above its
/// limit.
[[nodiscard]] std::string_view agree(std::span<Duration *const> values, std::string_view exceeds,
                                     const std::function<bool(std::size_t k)> &evaluate);

/// Bounds of `units` from the most urgent to the least. respond(k, alone) sets units[k].response from those of units[0
/// .. k), and answers false above its limit; explain(k) follows a call of it. Peers (peers_of()) are each taken as the
/// last of them, and not alone: their responses are the least that agree, from those that start() sets, or none has
/// one.
[[nodiscard]] Bound from_most_urgent(const System &system, std::vector<GlobalUnit> &units,
                                     const std::function<void(GlobalUnit &unit)> &start,
                                     const std::function<bool(std::size_t k, bool alone)> &respond,
                                     const std::function<ResponseBound(std::size_t k)> &explain);

/// agree() of the responses of `units`, which respond(k) sets: all have the bound that explain(k) then gives, or none;
/// none either where one is hopeless.
[[nodiscard]] Bound all_that_agree(const System &system, std::vector<GlobalUnit> &units, std::string_view exceeds,
                                   const std::function<bool(std::size_t k)> &respond,
                                   const std::function<ResponseBound(std::size_t k)> &explain);

}  // namespace redag::analysis::global
