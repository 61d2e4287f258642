// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Time in this project: int64 nanoseconds. A `Time` is a point on a steady clock (or the simulator's), a `Duration` a
// difference of two. Text form: a decimal number and a unit, "5ms", "1.5us". Pure functions.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag {

using Time = std::int64_t;
using Duration = std::int64_t;

inline constexpr Duration kNanosecond = 1;
inline constexpr Duration kMicrosecond = 1'000;
inline constexpr Duration kMillisecond = 1'000'000;
inline constexpr Duration kSecond = 1'000'000'000;

/// Later than every time that can be scheduled.
inline constexpr Time kNever = std::numeric_limits<Time>::max();

/// The longest duration accepted from outside (about 146 years): the sum of two never overflows.
inline constexpr Duration kMaxDuration = std::numeric_limits<Duration>::max() / 2;

/// The sum, or the first or last time that there is if it lies outside: "in 300 years" stays later than all that is
/// due.
[[nodiscard]] constexpr Time saturated_add(Time time, Duration duration) noexcept {
  Time sum = 0;
  if (!__builtin_add_overflow(time, duration, &sum)) return sum;
  return duration > 0 ? kNever : std::numeric_limits<Time>::min();
}

/// Reads "250ns", "3us", "1.5ms", "2s", "1min", "1h" (also "µs"); "0" needs no unit. Exact: it is an error if the value
/// has no unit, does not fit, or is not a whole number of nanoseconds. Reads a leading "-", for the caller to reject.
[[nodiscard]] Result<Duration> parse_duration(std::string_view text);

/// Reads a rate, "30Hz" or "1.5kHz", as its period to the nearest nanosecond: 33'333'333. Errors: no unit, a rate that
/// is not above 0, a period below 1 ns or above kMaxDuration.
[[nodiscard]] Result<Duration> parse_rate(std::string_view text);

/// Returns a text that parse_duration() reads back as the same value, in the largest unit (ns to s) that the duration
/// reaches: 1'500'000 -> "1.5ms", 200'000 -> "200us".
[[nodiscard]] std::string format_duration(Duration duration);

/// Formats a duration for people, with three or four significant digits and a suitable unit: 12'345'678 -> "12.35ms".
[[nodiscard]] std::string humanize_duration(Duration duration);

}  // namespace redag
