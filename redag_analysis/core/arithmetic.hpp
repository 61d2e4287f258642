// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Integer arithmetic of the bounds. No operation rounds in the unsafe direction, and none wraps. A sum that no duration
// can hold saturates at kUnbounded, which means "no bound". Pure functions.
#pragma once

#include <algorithm>

#include "redag/base/int128.hpp"
#include "redag/base/time.hpp"

namespace redag::analysis {

/// A value larger than every response time that counts as bounded.
inline constexpr Duration kUnbounded = kMaxDuration;

[[nodiscard]] constexpr Duration saturate(Int128 value) {
  return value >= kUnbounded ? kUnbounded : static_cast<Duration>(value);
}

/// Rounds up. Requires denominator > 0.
[[nodiscard]] constexpr Duration ceil_div(Duration numerator, Duration denominator) {
  return numerator / denominator + (numerator % denominator > 0 ? 1 : 0);
}

/// multiply() and add() saturate at kUnbounded and require non-negative arguments.
[[nodiscard]] constexpr Duration multiply(Duration a, Duration b) { return saturate(Int128{a} * b); }
[[nodiscard]] constexpr Duration add(Duration a, Duration b) { return saturate(Int128{a} + b); }

}  // namespace redag::analysis
