// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/rounded_time.hpp"

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"

namespace redag {
namespace {

TEST(RoundedTime, GoesToTheSideAsked) {
  EXPECT_EQ(humanize_down(106'600'001), "106.6ms");
  EXPECT_EQ(humanize_up(106'600'001), "106.7ms");
  EXPECT_EQ(humanize_down(12'345'678), "12.34ms");
  EXPECT_EQ(humanize_up(12'345'678), "12.35ms");
  EXPECT_EQ(humanize_up(9'999'999), "10ms");
  EXPECT_EQ(humanize_down(9'999'999), "9.999ms");
  EXPECT_EQ(humanize_down(1), "1ns");
  EXPECT_EQ(humanize_up(0), "0s");
  EXPECT_EQ(round_up(60'001), 60'010);
  EXPECT_EQ(round_up(9'999), 9'999);
}

TEST(RoundedTime, OfHoursAndDays) {
  constexpr Duration kMinute = 60 * kSecond;
  EXPECT_EQ(humanize_down(333 * kMinute + 59 * kSecond), "5h 33min");
  EXPECT_EQ(humanize_up(333 * kMinute + 1), "5h 34min");
  EXPECT_EQ(humanize_up(1439 * kMinute + 1), "1d");
  EXPECT_EQ(humanize_down(1439 * kMinute + 1), "23h 59min");
  EXPECT_EQ(humanize_up(1500 * kMinute + 1), "1d 2h");
  EXPECT_EQ(humanize_down(-1500 * kMinute - 1), "-1d 2h");
}

TEST(RoundedTime, OfLessThanNothing) {
  EXPECT_EQ(humanize_down(-12'345'678), "-12.35ms");
  EXPECT_EQ(humanize_up(-12'345'678), "-12.34ms");
  EXPECT_EQ(humanize_down(-5), "-5ns");
}

TEST(RoundedTime, NeverPromisesMore) {
  Rng rng(1);
  for (int i = 0; i < 20'000; ++i) {
    const Duration duration = rng.uniform(0, Duration{1} << rng.uniform(1, 41));
    const Duration down = *parse_duration(humanize_down(duration));
    const Duration up = *parse_duration(humanize_up(duration));
    ASSERT_LE(down, duration);
    ASSERT_GE(up, duration);
    ASSERT_LE(static_cast<double>(up - down), 1.1e-3 * static_cast<double>(duration) + 1);
  }
}

}  // namespace
}  // namespace redag
