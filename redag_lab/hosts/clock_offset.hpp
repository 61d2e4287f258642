// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How far the clock of a host is from the common one, as bounds that hold at each instant of a run. The offset is the
// host's clock minus the common clock: positive where the host's clock is ahead. Proof of the bounds: docs/hosts.md,
// "Uncertainty". Plain values and pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag::hosts {

/// A closed range of times or durations. Requires low <= high.
struct Interval {
  Duration low = 0;
  Duration high = 0;

  [[nodiscard]] Duration width() const { return high - low; }
  [[nodiscard]] Duration middle() const { return low + (high - low) / 2; }
  /// The distance from the middle to the farther end.
  [[nodiscard]] Duration radius() const { return high - middle(); }
  friend bool operator==(const Interval &, const Interval &) = default;
};

/// Where in a run an offset was read.
struct Instant {
  enum class Kind { Throughout, Start, End, After };
  Kind kind = Kind::Throughout;  // the offset and its uncertainty hold throughout the run
  Duration after = 0;            // After: since the start of the run

  friend bool operator==(const Instant &, const Instant &) = default;
};

/// The offset is `value`, give or take `uncertainty`, at this instant.
struct OffsetReading {
  Duration value = 0;
  Duration uncertainty = 0;
  Instant at = {};

  friend bool operator==(const OffsetReading &, const OffsetReading &) = default;
};

/// Longest offset and uncertainty: a day. A clock that is farther off was never set.
inline constexpr Duration kMostOffset = 24 * 3600 * kSecond;
/// Rates are in parts per billion. No clock of a computer drifts by 1 %.
inline constexpr Duration kMostRate = 10'000'000;

/// Reads "1.25ms", "-3us+-80us" (also "±") and "1.25ms+-80us@start": @start, @end, or @ and the time since the start.
/// Errors: ill-formed, a negative uncertainty, beyond kMostOffset.
[[nodiscard]] Result<OffsetReading> parse_offset(std::string_view text);

/// Reads a bound on the rate, "10ppm" or "0.25ppm", as parts per billion. Errors: ill-formed, negative, beyond
/// kMostRate, finer than 0.001 ppm.
[[nodiscard]] Result<Duration> parse_rate(std::string_view text);

/// What is known of a host's clock.
struct ClockStatement {
  std::string by = {};                       // who says so: "1.25ms+-80us", "chrony (arm/chrony.txt)"
  std::vector<OffsetReading> readings = {};  // of the user; at least one, unless `kept_within` is set
  std::optional<Interval> kept_within = {};  // by a time service, throughout the run
  std::optional<Duration> rate = {};         // in parts per billion: the most by which the offset changes
  Duration extra = 0;                        // added to every uncertainty
  bool needs_extra = false;                  // the time service does not state its uncertainty
};

/// The bounds of an offset over a run.
class ClockOffset {
 public:
  /// `start` and `end` are those of the run, in its time. `error` is that of the run's ClockReading. Errors: nothing is
  /// known; readings contradict each other, or say nothing about a part of the run.
  [[nodiscard]] static Result<ClockOffset> of(const ClockStatement &statement, Time start, Time end, Duration error);

  /// The offset at this time of the run, without the error of the reading, which is the same at all times.
  [[nodiscard]] Interval at(Time time) const;
  /// By how much the offset can change between two times of the run.
  [[nodiscard]] Interval change(Time from, Time to) const;
  /// The most by which the run's ClockReading is wrong.
  [[nodiscard]] Duration error() const { return error_; }

  /// The one offset by which the times of the run are shifted.
  [[nodiscard]] Duration shift() const { return shift_; }
  /// The most by which a shifted time of the run can be wrong.
  [[nodiscard]] Duration within() const { return within_; }

 private:
  struct Point {
    Time at = 0;
    Interval offset;
  };

  ClockOffset() = default;
  [[nodiscard]] Interval interpolated(Time time) const;
  [[nodiscard]] Interval by_rate(Time time) const;
  void summarize(Time start, Time end);

  std::vector<Point> points_;  // ascending; one: the offset is constant, unless there is a rate
  std::optional<Duration> rate_;
  Duration error_ = 0;
  Duration shift_ = 0;
  Duration within_ = 0;
};

}  // namespace redag::hosts
