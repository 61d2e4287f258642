// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_cost.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace redag::experiment {
namespace {

TEST(UnitCost, IsTheMeanOfDifferentUnits) {
  for (const std::uint64_t count : {1U, 2U, 3U, 8U, 100U, 987U}) {
    Time now = 0;
    std::set<std::uint64_t> seen;
    const std::atomic<bool> stop{false};
    const Result<UnitCost> cost = measure_cost(
        count, 3600 * kSecond,
        [&](std::uint64_t unit) -> Result<std::string> {
          EXPECT_LT(unit, count);
          EXPECT_TRUE(seen.insert(unit).second) << unit;
          now += unit % 2 == 0 ? 10 * kMillisecond : 30 * kMillisecond;
          return "";
        },
        [&now] { return now; }, stop);
    ASSERT_TRUE(cost);
    EXPECT_EQ(cost->measured, count) << "all units";
    EXPECT_EQ(seen.size(), count);
    EXPECT_NEAR(cost->mean, static_cast<double>(now) / static_cast<double>(count), 1.0);
  }
}

TEST(UnitCost, SomeUnitsAreEnough) {
  Time now = 0;
  const std::atomic<bool> stop{false};
  // The second half costs three times as much. Any stretch of the sample has units of both.
  const Result<UnitCost> cost = measure_cost(
      1'000'000, kSecond,
      [&now](std::uint64_t unit) -> Result<std::string> {
        now += unit < 500'000 ? kMillisecond : 3 * kMillisecond;
        return "";
      },
      [&now] { return now; }, stop);
  ASSERT_TRUE(cost);
  EXPECT_NEAR(static_cast<double>(cost->measured), 500, 5);
  EXPECT_NEAR(cost->mean, 2e6, 2e4);
  EXPECT_NEAR(cost->error, 1.96 * 1e6 / std::sqrt(500), 2e3);
}

TEST(UnitCost, ErrorsAndCtrlCEndIt) {
  std::atomic<bool> stop{false};
  Time now = 0;
  const auto clock = [&now] { return now; };
  EXPECT_FALSE(measure_cost(
      5, kSecond, [](std::uint64_t) -> Result<std::string> { return make_error("no"); }, clock, stop));
  const Result<UnitCost> cost = measure_cost(
      5, kSecond,
      [&](std::uint64_t) -> Result<std::string> {
        now += kMillisecond;
        stop = true;
        return "";
      },
      clock, stop);
  ASSERT_TRUE(cost);
  EXPECT_EQ(cost->measured, 1U);
  EXPECT_EQ(cost->error, 0);
}

}  // namespace
}  // namespace redag::experiment
