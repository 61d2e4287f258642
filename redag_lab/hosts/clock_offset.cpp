// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/clock_offset.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <string_view>
#include <utility>

#include "redag/base/int128.hpp"
#include "redag/base/text.hpp"

namespace redag::hosts {
namespace {

constexpr Duration kBillion = 1'000'000'000;

// Both round down or up, also below 0. Require a positive divisor.
Duration floor_divide(Int128 value, Int128 by) { return static_cast<Duration>(value / by - (value % by < 0 ? 1 : 0)); }
Duration ceil_divide(Int128 value, Int128 by) { return -floor_divide(-value, by); }

// The most by which an offset changes in `span`.
Duration drift(Duration rate, Duration span) { return ceil_divide(Int128{rate} * (span < 0 ? -span : span), kBillion); }

// Splits at the first of some marks. Returns nothing if there is none.
std::optional<std::pair<std::string_view, std::string_view>> split(std::string_view text,
                                                                   std::initializer_list<std::string_view> marks) {
  for (const std::string_view mark : marks) {
    const std::size_t at = text.find(mark);
    if (at != std::string_view::npos) return std::pair(text.substr(0, at), text.substr(at + mark.size()));
  }
  return std::nullopt;
}

Result<Instant> parse_instant(std::string_view text) {
  if (text == "start") return Instant{Instant::Kind::Start};
  if (text == "end") return Instant{Instant::Kind::End};
  const Result<Duration> after = parse_duration(text);
  if (!after || *after < 0) {
    return make_error(fmt::format("{} is no instant of a run", in_quotes(text)),
                      "write @start, @end, or the time since the start of the run: @12s");
  }
  return Instant{Instant::Kind::After, *after};
}

Time time_of(const Instant &instant, Time start, Time end) {
  switch (instant.kind) {
    case Instant::Kind::End: return end;
    case Instant::Kind::After: return start + instant.after;
    default: return start;
  }
}

}  // namespace

Result<OffsetReading> parse_offset(std::string_view text) {
  OffsetReading reading;
  std::string_view rest = text;
  if (const auto parts = split(rest, {"@"})) {
    const Result<Instant> at = parse_instant(parts->second);
    if (!at) return tl::unexpected<Diagnostics>(at.error());
    reading.at = *at;
    rest = parts->first;
  }
  const auto parts = split(rest, {"+-", "\u00b1", "+/-"});
  const Result<Duration> value = parse_duration(parts ? parts->first : rest);
  const Result<Duration> uncertainty = parts ? parse_duration(parts->second) : Result<Duration>(0);
  constexpr const char *kForm = "write an offset such as 1.25ms+-80us, or 1.25ms+-80us@start";
  if (!value || !uncertainty) {
    return make_error(fmt::format("{} is no offset: {}", in_quotes(text),
                                  (!value ? value.error() : uncertainty.error()).front().message),
                      kForm);
  }
  if (*uncertainty < 0) {
    return make_error(fmt::format("the uncertainty in {} is negative", in_quotes(text)), kForm);
  }
  if (*value < -kMostOffset || *value > kMostOffset || *uncertainty > kMostOffset) {
    return make_error(fmt::format("{} is more than a day", in_quotes(text)),
                      "set the clocks of the hosts before you record them");
  }
  reading.value = *value;
  reading.uncertainty = *uncertainty;
  return reading;
}

Result<Duration> parse_rate(std::string_view text) {
  // A rate has the form of a duration: 1 ppm is 1000 parts per billion, as 1 us is 1000 ns.
  constexpr std::string_view kUnit = "ppm";
  const bool has_unit = text.size() > kUnit.size() && text.ends_with(kUnit);
  const Result<Duration> rate =
      has_unit ? parse_duration(std::string(text.substr(0, text.size() - kUnit.size())) + "us") : make_error("");
  if (rate && *rate >= 0 && *rate <= kMostRate) return *rate;
  return make_error(fmt::format("{} is no bound on the rate of a clock", in_quotes(text)),
                    "write a number of parts per million up to 10000, to at most three decimals: 10ppm, 0.25ppm");
}

Result<ClockOffset> ClockOffset::of(const ClockStatement &statement, Time start, Time end, Duration error) {
  ClockOffset offset;
  offset.error_ = error;
  offset.rate_ = statement.rate;
  const auto throughout = std::count_if(statement.readings.begin(), statement.readings.end(), [](const auto &reading) {
    return reading.at.kind == Instant::Kind::Throughout;
  });
  if (statement.kept_within && !statement.readings.empty()) {
    return make_error("both an offset and the text of a time service are given", "keep one of them");
  }
  if (throughout > 0 && (statement.readings.size() > 1 || statement.rate)) {
    return make_error(statement.rate ? "an offset with a rate needs the instant at which it was read"
                                     : "several offsets need the instants at which they were read",
                      "write for example 1.25ms+-80us@start and 1.31ms+-80us@end");
  }
  if (statement.needs_extra && statement.extra == 0) {
    return make_error("the text of linuxptp states an offset, but not how wrong it can be",
                      "save pmc's answer to GET CURRENT_DATA_SET with it (one step from the grandmaster), or state the "
                      "uncertainty");
  }
  if (statement.kept_within) {
    if (statement.rate) return make_error("a time service keeps the clock, and no rate is needed", "remove the rate");
    offset.points_.push_back({start, *statement.kept_within});
  }
  for (const OffsetReading &reading : statement.readings) {
    offset.points_.push_back(
        {time_of(reading.at, start, end), {reading.value - reading.uncertainty, reading.value + reading.uncertainty}});
  }
  if (offset.points_.empty()) {
    return make_error(
        "nothing says how far its clock is from the others",
        "write 0 for the clock that the others are compared with, or else an offset such as 1.25ms+-80us");
  }
  for (Point &point : offset.points_) {
    point.offset.low -= statement.extra;
    point.offset.high += statement.extra;
  }
  std::stable_sort(offset.points_.begin(), offset.points_.end(),
                   [](const Point &a, const Point &b) { return a.at < b.at; });
  const std::vector<Point> &points = offset.points_;
  const bool is_constant = throughout > 0 || statement.kept_within.has_value();
  if (!is_constant && !statement.rate && (points.size() < 2 || points.front().at > start || points.back().at < end)) {
    return make_error("the offset is only known for a part of the run",
                      "give the offset @start and @end, or a bound on the rate");
  }
  if (!statement.rate) {
    for (std::size_t i = 1; i < points.size(); ++i) {
      if (points[i].at == points[i - 1].at) return make_error("two offsets are given for the same instant");
    }
  } else {
    for (const Point &point : points) {
      const Interval left = offset.by_rate(point.at);
      if (left.low > left.high) {
        return make_error("the offsets differ by more than their uncertainties and the rate allow",
                          "raise the rate, or the uncertainties");
      }
    }
  }
  offset.summarize(start, end);
  return offset;
}

Interval ClockOffset::at(Time time) const {
  if (rate_) return by_rate(time);
  return points_.size() == 1 ? points_.front().offset : interpolated(time);
}

// Every reading bounds the offset at all times, and so do all of them together.
Interval ClockOffset::by_rate(Time time) const {
  Interval all{std::numeric_limits<Duration>::min(), std::numeric_limits<Duration>::max()};
  for (const Point &point : points_) {
    const Duration most = drift(*rate_, time - point.at);
    all.low = std::max(all.low, point.offset.low - most);
    all.high = std::min(all.high, point.offset.high + most);
  }
  return all;
}

// Between two readings the clock has one rate. An offset that is a line lies between the lines through the ends of its
// bounds. The few times before the first reading and after the last one continue the nearest lines.
Interval ClockOffset::interpolated(Time time) const {
  auto after = std::find_if(points_.begin() + 1, points_.end() - 1, [time](const Point &p) { return p.at >= time; });
  const Point &b = *after;
  const Point &a = *(after - 1);
  const Int128 span = Int128{b.at} - a.at;
  const Int128 done = Int128{time} - a.at;
  const auto between = [&](Duration from, Duration to) { return Int128{from} * (span - done) + Int128{to} * done; };
  const Int128 one = between(a.offset.low, b.offset.low);
  const Int128 other = between(a.offset.high, b.offset.high);
  if (done < 0 || done > span) {
    // Beyond the readings, the steepest line that they allow is one between opposite ends.
    const Int128 low =
        std::min({one, other, between(a.offset.low, b.offset.high), between(a.offset.high, b.offset.low)});
    const Int128 high =
        std::max({one, other, between(a.offset.low, b.offset.high), between(a.offset.high, b.offset.low)});
    return {floor_divide(low, span), ceil_divide(high, span)};
  }
  return {floor_divide(one, span), ceil_divide(other, span)};
}

Interval ClockOffset::change(Time from, Time to) const {
  if (from == to) return {};
  const Interval before = at(from);
  const Interval after = at(to);
  Interval change{after.low - before.high, after.high - before.low};
  if (rate_) {
    const Duration most = drift(*rate_, to - from);
    change = {std::max(change.low, -most), std::min(change.high, most)};
  }
  return change;
}

// The bounds are linear between samples, or change no faster than the rate.
void ClockOffset::summarize(Time start, Time end) {
  shift_ = at(start + (end - start) / 2).middle();
  constexpr int kSamples = 64;
  const Duration step = (end - start) / kSamples + 1;
  std::vector<Time> times = {start, end};
  for (const Point &point : points_) times.push_back(std::clamp(point.at, start, end));
  if (rate_) {
    for (int i = 1; i < kSamples; ++i) times.push_back(start + i * ((end - start) / kSamples));
  }
  for (const Time time : times) {
    const Interval bounds = at(time);
    within_ = std::max({within_, bounds.high - shift_, shift_ - bounds.low});
  }
  within_ += error_ + (rate_ ? drift(*rate_, step) : 0);
}

}  // namespace redag::hosts
