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

}  // namespace

Result<Duration> parse_duration(std::string_view text) {
  const auto fail = [&](std::string_view why) {
    return make_error(fmt::format("{} is not a duration: {}", in_quotes(text), why),
                      "write a number and a unit, as in 5ms");
  };
  std::string_view rest = text;
  const bool negative = rest.starts_with('-');
  if (negative) rest.remove_prefix(1);

  // Collects the digits in one integer and notes the decimal point, which avoids rounding.
  Int128 digits = 0;
  Int128 scale = 1;
  std::size_t used = 0;
  bool any_digit = false;
  bool after_point = false;
  for (; used < rest.size(); ++used) {
    const char c = rest[used];
    if (c == '.' && !after_point) {
      after_point = true;
    } else if (is_digit(c)) {
      any_digit = true;
      if (digits > Int128{kMaxDuration} * 10)
        return fail(fmt::format("it is too large; at most {} is allowed", kMaxDurationText));
      digits = digits * 10 + (c - '0');
      if (after_point) scale *= 10;
      if (scale > Int128{kMaxDuration}) return fail("it has too many decimals");
    } else {
      break;
    }
  }
  if (!any_digit) return fail("it does not begin with a number");

  std::string_view unit_name = rest.substr(used);
  while (unit_name.starts_with(' ')) unit_name.remove_prefix(1);
  if (unit_name.empty()) {
    if (digits == 0) return Duration{0};
    return fail("it has no unit (ns, us, ms, s, min, h)");
  }
  const Unit *unit = find_unit(unit_name);
  if (unit == nullptr) return fail(fmt::format("unknown unit {} (ns, us, ms, s, min, h)", in_quotes(unit_name)));

  const Int128 scaled = digits * unit->nanoseconds;
  if (scale != 1 && scaled % scale != 0) return fail("it is not a whole number of nanoseconds");
  const Int128 value = scale == 1 ? scaled : scaled / scale;
  if (value > Int128{kMaxDuration})
    return fail(fmt::format("it is too large; at most {} is allowed", kMaxDurationText));
  return static_cast<Duration>(negative ? -value : value);
}

std::string format_duration(Duration duration) {
  if (duration == 0) return "0s";
  const bool negative = duration < 0;
  const auto magnitude = negative ? -static_cast<Int128>(duration) : static_cast<Int128>(duration);
  std::string best;
  for (const Unit &unit : kUnits) {
    if (unit.nanoseconds > kSecond || !(unit.name[0] >= 'a' && unit.name[0] <= 'z')) continue;
    const auto whole = static_cast<std::int64_t>(magnitude / unit.nanoseconds);
    auto fraction = static_cast<std::int64_t>(magnitude % unit.nanoseconds);
    std::string text = fmt::format("{}", whole);
    if (fraction != 0) {
      std::string decimals;
      for (Duration place = unit.nanoseconds / 10; fraction != 0; place /= 10) {
        decimals += static_cast<char>('0' + fraction / place);
        fraction %= place;
      }
      text += "." + decimals;
    }
    text += unit.name;
    if (best.empty() || text.size() < best.size()) best = text;
  }
  return negative ? "-" + best : best;
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
