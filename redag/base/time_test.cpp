// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/time.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace redag {
namespace {

TEST(SaturatedAdd, StaysWithinWhatThereIs) {
  EXPECT_EQ(saturated_add(5, 7), 12);
  EXPECT_EQ(saturated_add(5, kNever), kNever);
  EXPECT_EQ(saturated_add(-5, kNever), kNever - 5);
  EXPECT_EQ(saturated_add(std::numeric_limits<Time>::min(), -1), std::numeric_limits<Time>::min());
}

TEST(ParseDuration, ReadsEveryUnit) {
  EXPECT_EQ(parse_duration("250ns"), 250);
  EXPECT_EQ(parse_duration("3us"), 3 * kMicrosecond);
  EXPECT_EQ(parse_duration("3\xC2\xB5s"), 3 * kMicrosecond);
  EXPECT_EQ(parse_duration("3\xCE\xBCs"), 3 * kMicrosecond);
  EXPECT_EQ(parse_duration("1.5ms"), 1'500'000);
  EXPECT_EQ(parse_duration("2s"), 2 * kSecond);
  EXPECT_EQ(parse_duration("1min"), 60 * kSecond);
  EXPECT_EQ(parse_duration("1h"), 3600 * kSecond);
  EXPECT_EQ(parse_duration("5 ms"), 5 * kMillisecond);
}

TEST(ParseDuration, ZeroNeedsNoUnitAndMinusIsRead) {
  EXPECT_EQ(parse_duration("0"), 0);
  EXPECT_EQ(parse_duration("-5ms"), -5 * kMillisecond);
}

TEST(ParseDuration, LimitsAreExact) {
  EXPECT_EQ(parse_duration("4611686018427387903ns"), kMaxDuration);
  EXPECT_FALSE(parse_duration("4611686018427387904ns"));
}

struct Refused {
  const char *text;
  const char *why;
};

class ParseDurationRefuses : public testing::TestWithParam<Refused> {};

TEST_P(ParseDurationRefuses, WithAReason) {
  const Result<Duration> result = parse_duration(GetParam().text);
  ASSERT_FALSE(result);
  EXPECT_NE(to_string(result.error()).find(GetParam().why), std::string::npos) << to_string(result.error());
}

INSTANTIATE_TEST_SUITE_P(
    Table, ParseDurationRefuses,
    testing::Values(Refused{"", "does not begin with a number"}, Refused{"ms", "does not begin with a number"},
                    Refused{".", "does not begin with a number"}, Refused{"--5ms", "does not begin with a number"},
                    Refused{"5", "it has no unit"}, Refused{"5.0", "it has no unit"},
                    Refused{"5 parsec", "unknown unit"}, Refused{"5MS", "unknown unit"},
                    Refused{"1e3ms", "unknown unit"}, Refused{"5ms ", "unknown unit"},
                    Refused{"1.2.3ms", "unknown unit"}, Refused{"nan", "does not begin"},
                    Refused{"0.5ns", "not a whole number of nanoseconds"},
                    Refused{"1.0000001ms", "not a whole number of nanoseconds"},
                    Refused{"0.00000000000000000000001s", "too many decimals"},
                    Refused{"99999999999999999999999999h", "too large"}, Refused{"200000000min", "too large"}));

RC_GTEST_PROP(FormatDuration, ParsesBackToTheSameValue, ()) {
  const auto value = *rc::gen::inRange<Duration>(-kMaxDuration, kMaxDuration);
  RC_ASSERT(parse_duration(format_duration(value)) == value);
}

TEST(ParseDuration, ShowsThePeriodOfARate) {
  const Result<Duration> result = parse_duration("100Hz");
  ASSERT_FALSE(result);
  EXPECT_EQ(to_string(result.error()), "error: '100Hz' is not a duration: it is a rate (write its period, 10ms)");
}

TEST(ParseRate, GivesThePeriodToTheNearestNanosecond) {
  EXPECT_EQ(parse_rate("400Hz"), 2'500'000);
  EXPECT_EQ(parse_rate("1 kHz"), kMillisecond);
  EXPECT_EQ(parse_rate("0.5Hz"), 2 * kSecond);
  EXPECT_EQ(parse_rate("30Hz"), 33'333'333);
  EXPECT_EQ(parse_rate("60Hz"), 16'666'667);
  EXPECT_EQ(parse_rate("29.97Hz"), 33'366'700);
  EXPECT_EQ(parse_rate("1000000kHz"), 1);
}

TEST(ParseRate, RefusesWithAReason) {
  for (const auto &[text, why] :
       {Refused{"30", "it has no unit"}, Refused{"Hz", "does not begin with a number"}, Refused{"0Hz", "greater than"},
        Refused{"-3Hz", "does not begin"}, Refused{"5ms", "it is a duration"}, Refused{"30hz", "unknown unit 'hz'"},
        Refused{"3000000kHz", "below 1ns"}, Refused{"0.0000000001Hz", "longer than"}}) {
    const Result<Duration> result = parse_rate(text);
    ASSERT_FALSE(result) << text;
    EXPECT_NE(to_string(result.error()).find(why), std::string::npos) << to_string(result.error());
  }
}

RC_GTEST_PROP(ParseRate, NeverCrashesOnText, (const std::string &text)) {
  const Result<Duration> period = parse_rate(text);
  RC_ASSERT((!period || (*period > 0 && *period <= kMaxDuration)));  // rapidcheck evaluates both sides of its own ||
}

RC_GTEST_PROP(ParseDuration, NeverCrashesOnText, (const std::string &text)) {
  const Result<Duration> result = parse_duration(text);
  RC_ASSERT((result.has_value() || result.error().size() == 1));
}

TEST(FormatDuration, UsesTheLargestUnitThatTheDurationReaches) {
  EXPECT_EQ(format_duration(200 * kMicrosecond), "200us");
  EXPECT_EQ(format_duration(33'333'333), "33.333333ms");
  EXPECT_EQ(format_duration(1'234'567), "1.234567ms");
  EXPECT_EQ(format_duration(90 * kSecond), "90s");
  EXPECT_EQ(format_duration(-500), "-500ns");
  EXPECT_EQ(format_duration(0), "0s");
  EXPECT_EQ(format_duration(1'500'000), "1.5ms");
  EXPECT_EQ(format_duration(20 * kMillisecond), "20ms");
  EXPECT_EQ(format_duration(-3), "-3ns");
  EXPECT_EQ(format_duration(kSecond), "1s");
}

TEST(HumanizeDuration, RoundsToFourDigits) {
  EXPECT_EQ(humanize_duration(12'345'678), "12.35ms");
  EXPECT_EQ(humanize_duration(-12'345'678), "-12.35ms");
  EXPECT_EQ(humanize_duration(0), "0s");
  EXPECT_EQ(humanize_duration(999), "999ns");
  EXPECT_EQ(humanize_duration(63'360 * kMillisecond), "63.36s");
  EXPECT_EQ(humanize_duration(20'000 * kSecond), "5h 33min");
  EXPECT_EQ(humanize_duration(3600 * kSecond), "1h");
  EXPECT_EQ(humanize_duration(-86'399 * kSecond), "-1d");
  EXPECT_EQ(humanize_duration(33'333'333 * kSecond), "385d 19h");
}

}  // namespace
}  // namespace redag
