// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/time.hpp"

#include <array>
#include <cmath>
#include <cstdlib>

#include <fmt/format.h>

#include "redag/base/int128.hpp"
#include "redag/base/text.hpp"

namespace redag {
namespace {

struct Unit {
  std::string_view name;
  Duration nanoseconds;
};

// Longest first, because format_duration() looks for the largest unit that fits. "\xC2\xB5" and "\xCE\xBC" are the two
// code points that people type for micro.
constexpr std::array kUnits = {
    Unit{"h", 3600 * kSecond},       Unit{"min", 60 * kSecond},       Unit{"s", kSecond},
    Unit{"ms", kMillisecond},        Unit{"us", kMicrosecond},        Unit{"ns", kNanosecond},
    Unit{"\xC2\xB5s", kMicrosecond}, Unit{"\xCE\xBCs", kMicrosecond},
};

const Unit *find_unit(std::string_view name) {
  for (const Unit &unit : kUnits) {
    if (unit.name == name) return &unit;
  }
  return nullptr;
}

constexpr Duration kHour = 3600 * kSecond;
constexpr Duration kDay = 24 * kHour;

// Returns "5h 33min" or "12d 7h", rounded to the smaller unit.
std::string long_duration(Duration duration) {
  const Duration step = duration >= kDay || duration <= -kDay ? kHour : 60 * kSecond;
  const Duration whole = std::abs(duration / step + duration % step / (step / 2));  // in steps
  const Duration unit = whole * step >= kDay ? kDay : kHour;
  const Duration small = unit == kDay ? kHour : 60 * kSecond;
  const Duration rest = whole * step % unit / small;
  const std::string text = fmt::format("{}{}", whole * step / unit, unit == kDay ? "d" : "h");
  return rest == 0 ? text : fmt::format("{} {}{}", text, rest, unit == kDay ? "h" : "min");
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// A decimal number, digits / scale, and the text after it. Collects the digits in one integer and notes the decimal
/// point, which avoids rounding.
struct Quantity {
  Int128 digits = 0;
  Int128 scale = 1;
  std::string_view unit;
};

constexpr const char *kTooLarge = "it is too large";

/// Returns why `text` does not begin with a number, or null.
const char *split(std::string_view text, Quantity &quantity) {
  std::size_t used = 0;
  bool any_digit = false;
  bool after_point = false;
  for (; used < text.size(); ++used) {
    const char c = text[used];
    if (c == '.' && !after_point) {
      after_point = true;
    } else if (is_digit(c)) {
      any_digit = true;
      if (quantity.digits > Int128{kMaxDuration} * 10) return kTooLarge;
      quantity.digits = quantity.digits * 10 + (c - '0');
      if (after_point) quantity.scale *= 10;
      if (quantity.scale > Int128{kMaxDuration}) return "it has too many decimals";
    } else {
      break;
    }
  }
  if (!any_digit) return "it does not begin with a number";
  quantity.unit = text.substr(used);
  while (quantity.unit.starts_with(' ')) quantity.unit.remove_prefix(1);
  return nullptr;
}

/// Returns the rate's unit in hertz; 0: it is not one.
std::int64_t hertz_of(std::string_view unit) {
  if (unit == "Hz") return 1;
  return unit == "kHz" ? 1000 : 0;
}

}  // namespace

Result<Duration> parse_duration(std::string_view text) {
  const auto fail = [&](std::string_view why, const char *hint = "write a number and a unit, as in 5ms") {
    return make_error(fmt::format("{} is not a duration: {}", in_quotes(text), why), hint);
  };
  const auto too_large = [] { return fmt::format("it is too large; at most {} is allowed", kMaxDurationText); };
  const bool negative = text.starts_with('-');
  Quantity quantity;
  if (const char *why = split(text.substr(negative ? 1 : 0), quantity)) {
    return why == kTooLarge ? fail(too_large()) : fail(why);
  }
  if (quantity.unit.empty()) {
    if (quantity.digits == 0) return Duration{0};
    return fail("it has no unit (ns, us, ms, s, min, h)");
  }
  const Unit *unit = find_unit(quantity.unit);
  if (unit == nullptr) {
    if (const Result<Duration> period = parse_rate(text)) {
      return fail("it is a rate", fmt::format("write its period, {}", format_duration(*period)).c_str());
    }
    return fail(fmt::format("unknown unit {} (ns, us, ms, s, min, h)", in_quotes(quantity.unit)));
  }
  const Int128 scaled = quantity.digits * unit->nanoseconds;
  if (scaled % quantity.scale != 0) return fail("it is not a whole number of nanoseconds");
  const Int128 value = scaled / quantity.scale;
  if (value > Int128{kMaxDuration}) return fail(too_large());
  return static_cast<Duration>(negative ? -value : value);
}

Result<Duration> parse_rate(std::string_view text) {
  const auto fail = [&](std::string_view why, std::string_view hint = "write a number and a unit, as in 30Hz") {
    return make_error(fmt::format("{} is not a rate: {}", in_quotes(text), why), std::string(hint));
  };
  Quantity quantity;
  if (const char *why = split(text, quantity)) return fail(why);
  if (quantity.unit.empty()) return fail("it has no unit (Hz, kHz)");
  const std::int64_t hertz = hertz_of(quantity.unit);
  if (hertz == 0) {
    if (find_unit(quantity.unit) != nullptr) return fail("it is a duration", "write it as 'period:'");
    return fail(fmt::format("unknown unit {} (Hz, kHz)", in_quotes(quantity.unit)));
  }
  if (quantity.digits == 0) return fail("it must be greater than zero");
  const Int128 rate = quantity.digits * hertz;
  const Int128 period = (Int128{kSecond} * quantity.scale * 2 + rate) / (rate * 2);
  if (period < 1) return fail("its period is below 1ns");
  if (period > Int128{kMaxDuration}) return fail(fmt::format("its period is longer than {}", kMaxDurationText));
  return static_cast<Duration>(period);
}

std::string format_duration(Duration duration) {
  if (duration == 0) return "0s";
  const bool negative = duration < 0;
  const auto magnitude = negative ? -static_cast<Int128>(duration) : static_cast<Int128>(duration);
  for (const Unit &unit : kUnits) {
    if (unit.nanoseconds > kSecond || magnitude < unit.nanoseconds) continue;
    std::string text = fmt::format("{}", static_cast<std::int64_t>(magnitude / unit.nanoseconds));
    auto fraction = static_cast<std::int64_t>(magnitude % unit.nanoseconds);
    if (fraction != 0) text += '.';
    for (Duration place = unit.nanoseconds / 10; fraction != 0; place /= 10) {
      text += static_cast<char>('0' + fraction / place);
      fraction %= place;
    }
    return (negative ? "-" : "") + text.append(unit.name);
  }
  return {};  // not reached: every magnitude is at least one nanosecond
}

std::string humanize_duration(Duration duration) {
  if (duration >= kHour || duration <= -kHour) return (duration < 0 ? "-" : "") + long_duration(duration);
  const double magnitude = std::fabs(static_cast<double>(duration));
  for (const Unit &unit : kUnits) {
    if (unit.nanoseconds > kSecond || magnitude < static_cast<double>(unit.nanoseconds)) continue;
    return fmt::format("{:.4g}{}", static_cast<double>(duration) / static_cast<double>(unit.nanoseconds), unit.name);
  }
  return "0s";
}

}  // namespace redag
