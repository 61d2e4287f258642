// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/clock_offset.hpp"

#include <gtest/gtest.h>

namespace redag::hosts {
namespace {

OffsetReading offset(std::string_view text) {
  const Result<OffsetReading> reading = parse_offset(text);
  EXPECT_TRUE(reading) << text;
  return reading.value_or(OffsetReading{});
}

std::string refusal_of(const ClockStatement &statement) {
  const Result<ClockOffset> clock = ClockOffset::of(statement, 0, 10 * kSecond, 0);
  return clock ? "accepted" : clock.error().front().message;
}

ClockOffset clock_of(const ClockStatement &statement, Duration error = 0) {
  Result<ClockOffset> clock = ClockOffset::of(statement, 0, 10 * kSecond, error);
  EXPECT_TRUE(clock) << (clock ? "" : to_string(clock.error()));
  return *std::move(clock);
}

TEST(ClockOffset, ReadsOffsets) {
  EXPECT_EQ(offset("0"), OffsetReading{});
  EXPECT_EQ(offset("1.25ms+-80us"), (OffsetReading{1'250'000, 80'000, {}}));
  EXPECT_EQ(offset("-3us\u00b140ns"), (OffsetReading{-3'000, 40, {}}));
  EXPECT_EQ(offset("-3us+/-40ns@end"), (OffsetReading{-3'000, 40, {Instant::Kind::End}}));
  EXPECT_EQ(offset("2us@start"), (OffsetReading{2'000, 0, {Instant::Kind::Start}}));
  EXPECT_EQ(offset("2us+-1us@1.5s"), (OffsetReading{2'000, 1'000, {Instant::Kind::After, 1'500'000'000}}));
  for (const char *bad :
       {"", "5", "1ms+-", "1ms+-2", "1ms+--2us", "1ms@", "1ms@noon", "1ms@-2s", "25h", "+-1us", "1ms+-25h"}) {
    EXPECT_FALSE(parse_offset(bad)) << bad;
  }
  EXPECT_EQ(parse_offset("1ms+--2us").error().front().message, "the uncertainty in '1ms+--2us' is negative");
}

TEST(ClockOffset, ReadsRates) {
  EXPECT_EQ(parse_rate("10ppm").value_or(-1), 10'000);
  EXPECT_EQ(parse_rate("0.25ppm").value_or(-1), 250);
  for (const char *bad : {"", "10", "ppm", "-1ppm", "10001ppm", "0.0001ppm", "1 ppb", "1usppm"}) {
    EXPECT_FALSE(parse_rate(bad)) << bad;
  }
}

TEST(ClockOffset, HoldsThroughoutTheRun) {
  const ClockOffset clock = clock_of({.readings = {{1'000, 80, {}}}, .extra = 20}, 5);
  EXPECT_EQ(clock.at(0), (Interval{900, 1'100}));
  EXPECT_EQ(clock.at(9 * kSecond), (Interval{900, 1'100}));
  EXPECT_EQ(clock.change(0, kSecond), (Interval{-200, 200}));
  EXPECT_EQ(clock.change(5, 5), Interval{});
  EXPECT_EQ(clock.shift(), 1'000);
  EXPECT_EQ(clock.within(), 105);
}

TEST(ClockOffset, IsALineBetweenTwoInstants) {
  const ClockOffset clock =
      clock_of({.readings = {{1'000, 10, {Instant::Kind::Start}}, {2'000, 30, {Instant::Kind::End}}}});
  EXPECT_EQ(clock.at(0), (Interval{990, 1'010}));
  EXPECT_EQ(clock.at(5 * kSecond), (Interval{1'480, 1'520}));
  EXPECT_EQ(clock.at(10 * kSecond), (Interval{1'970, 2'030}));
  EXPECT_EQ(clock.shift(), 1'500);
  EXPECT_EQ(clock.within(), 530);
  // Beyond the instants the steepest lines count: from 1010 to 1970, and from 990 to 2030.
  EXPECT_EQ(clock.at(20 * kSecond), (Interval{2'930, 3'070}));
}

TEST(ClockOffset, WidensByTheRate) {
  const ClockOffset clock =
      clock_of({.readings = {{1'000, 10, {Instant::Kind::After, 2 * kSecond}}}, .rate = 100});  // 0.1 ppm
  EXPECT_EQ(clock.at(2 * kSecond), (Interval{990, 1'010}));
  EXPECT_EQ(clock.at(10 * kSecond), (Interval{190, 1'810}));
  EXPECT_EQ(clock.at(0), (Interval{790, 1'210}));
  EXPECT_EQ(clock.change(8 * kSecond, 9 * kSecond), (Interval{-100, 100}));
  EXPECT_GE(clock.within(), 810);
  // A second reading narrows it again.
  const ClockOffset both =
      clock_of({.readings = {{1'000, 10, {Instant::Kind::Start}}, {1'100, 10, {Instant::Kind::End}}}, .rate = 100});
  EXPECT_EQ(both.at(10 * kSecond), (Interval{1'090, 1'110}));
  EXPECT_EQ(both.at(5 * kSecond), (Interval{590, 1'510}));
}

TEST(ClockOffset, IsWithinWhatATimeServiceKept) {
  const ClockOffset clock = clock_of({.kept_within = Interval{-30, 50}});
  EXPECT_EQ(clock.at(kSecond), (Interval{-30, 50}));
  EXPECT_EQ(clock.shift(), 10);
  EXPECT_EQ(clock.within(), 40);
}

TEST(ClockOffset, RefusesWhatSaysTooLittleOrTooMuch) {
  const OffsetReading always{1'000, 10, {}};
  const OffsetReading first{1'000, 10, {Instant::Kind::Start}};
  const OffsetReading last{2'000, 10, {Instant::Kind::End}};
  EXPECT_EQ(refusal_of({}), "nothing says how far its clock is from the others");
  EXPECT_EQ(refusal_of({.readings = {always}}), "accepted");
  EXPECT_EQ(refusal_of({.readings = {always, last}}), "several offsets need the instants at which they were read");
  EXPECT_EQ(refusal_of({.readings = {always}, .rate = 5}),
            "an offset with a rate needs the instant at which it was read");
  EXPECT_EQ(refusal_of({.readings = {first}}), "the offset is only known for a part of the run");
  EXPECT_EQ(refusal_of({.readings = {first, {1'500, 10, {Instant::Kind::After, kSecond}}}}),
            "the offset is only known for a part of the run");
  EXPECT_EQ(refusal_of({.readings = {first, first, last}}), "two offsets are given for the same instant");
  EXPECT_EQ(refusal_of({.readings = {first, last}, .rate = 97}),
            "the offsets differ by more than their uncertainties and the rate allow");
  EXPECT_EQ(refusal_of({.readings = {first, last}, .rate = 98}), "accepted");
  EXPECT_EQ(refusal_of({.readings = {always}, .kept_within = Interval{}}),
            "both an offset and the text of a time service are given");
  EXPECT_EQ(refusal_of({.kept_within = Interval{}, .rate = 5}),
            "a time service keeps the clock, and no rate is needed");
  EXPECT_EQ(refusal_of({.kept_within = Interval{}, .needs_extra = true}),
            "the text of linuxptp states an offset, but not how wrong it can be");
  EXPECT_EQ(refusal_of({.kept_within = Interval{}, .extra = 1, .needs_extra = true}), "accepted");
}

}  // namespace
}  // namespace redag::hosts
