// Fixed points of the bounds for several workers: of one window, and of responses that rely on each other. Every
// function iterated is monotone: larger windows and larger responses assumed of others never give less.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "redag/analysis/bound.hpp"
#include "redag/analysis/global.hpp"

namespace redag::analysis::global {

/// Least fixed point of a monotone `next`, from a `value` below it on. False above `stop`, or after kMaxSteps. The last
/// call of `next` was with the `value` found, so that what it leaves behind is of that one.
template <class Next>
[[nodiscard]] bool least_fixed_point(Duration stop, Duration &value, Next next) {
  for (int steps = 0; value <= stop && steps < kMaxSteps; ++steps) {
    const Duration grown = next(value);
    if (grown <= value) return true;
    value = grown;
  }
  return false;
}

/// One of several responses (or latest arrivals) that rely on each other.
struct Reliant {
  Duration *value = nullptr;
  Duration limit = 0;  // no bound above it; `value` is never set to more before an evaluation
};

/// Sets all values to responses that agree: each is at least what evaluate(k) makes of the others. evaluate(k) sets the
/// k-th value from all of them, and answers false above its limit; it must be monotone. Values start at or below the
/// least that agree, and those are found, except where they take more than a thousand rounds: then larger ones that
/// agree, if there are any within reach (docs/analysis.md, "EDF on several workers"). Empty, or why there are none;
/// `exceeds` if some value exceeds its limit.
[[nodiscard]] std::string_view agree(std::span<const Reliant> values, std::string_view exceeds,
                                     const std::function<bool(std::size_t k)> &evaluate);

/// The same of the responses of `units`, which respond(k) sets: all have the bound that explain(k) then gives, or none.
[[nodiscard]] Bound all_that_agree(const System &system, std::vector<GlobalUnit> &units, std::string_view exceeds,
                                   const std::function<bool(std::size_t k)> &respond,
                                   const std::function<ResponseBound(std::size_t k)> &explain);

}  // namespace redag::analysis::global
