// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Fixed points of the bounds for several workers: of one window, and of responses that rely on each other. Every
// iterated function is monotone: larger windows, and larger assumed responses of others, never give a smaller result.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis::global {

/// Finds a fixed point of a monotone `next`, from a `value` at or below the least one. Returns false if it is above
/// `stop`. The last call of `next` was with the `value` found, and its side effects are those of that value. The result
/// is the least fixed point unless the search takes more than kMaxSteps. Then it is one from farther ahead, found by
/// doubling the distance and bisection, if there is one where these look.
template <class Next>
[[nodiscard]] bool least_fixed_point(Duration stop, Duration &value, Next next) {
  const Duration begin = value;
  for (int steps = 0; value <= stop && steps < kMaxSteps; ++steps) {
    const Duration grown = next(value);
    if (grown <= value) return true;
    value = grown;
  }
  // next(value) > value here. Goes ahead to the first place with next(above) <= above; bisection finds a fixed point
  // between it and the place before.
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

/// Sets responses (or latest arrivals) that rely on each other to the least values that agree: each is what evaluate(k)
/// computes from the others. evaluate(k) sets the k-th value from all of them, and returns false above its limit; it
/// must be monotone. Values start at or below the least that agree. Returns an empty text, or why no values agree:
/// `exceeds` if one is above its limit.
[[nodiscard]] std::string_view agree(std::span<Duration *const> values, std::string_view exceeds,
                                     const std::function<bool(std::size_t k)> &evaluate);

/// A narrow() for from_most_urgent() that only changes the unit.
[[nodiscard]] std::function<void(GlobalUnit &unit, const Part *part)> narrows_to_part(const TaskSet &task_set);

/// Bounds `units` from the most urgent to the least. respond(k, alone) sets units[k].response from those of units[0 ..
/// k), and returns false above its limit; explain(k) follows a call of it. Each of several peers (peers_of()) is
/// treated as the last of them, with `alone` false. Their responses are the least that agree, beginning with those that
/// start() sets; otherwise none of them has one. In a unit with a bound each task has one of its own: that of the part
/// of the unit before its end. narrow() leaves that part of units[k], and null gives back the whole. Below a unit
/// without a bound none has one, unless `overlap`: then assume_overlap() holds for that unit.
[[nodiscard]] Bound from_most_urgent(const TaskSet &task_set, std::vector<GlobalUnit> &units,
                                     const std::function<void(GlobalUnit &unit)> &start,
                                     const std::function<bool(std::size_t k, bool alone)> &respond,
                                     const std::function<ResponseBound(std::size_t k)> &explain,
                                     const std::function<void(GlobalUnit &unit, const Part *part)> &narrow = nullptr,
                                     bool overlap = false);

/// Applies agree() to the responses of `units`, which respond(k) sets. All units have the bound that explain(k) gives,
/// or none has; none has if one unit is hopeless.
[[nodiscard]] Bound all_that_agree(const TaskSet &task_set, std::vector<GlobalUnit> &units, std::string_view exceeds,
                                   const std::function<bool(std::size_t k)> &respond,
                                   const std::function<ResponseBound(std::size_t k)> &explain);

}  // namespace redag::analysis::global
