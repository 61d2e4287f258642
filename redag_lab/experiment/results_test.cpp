// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/results.hpp"

#include <gtest/gtest.h>
#include <cmath>

#include <numeric>

#include "redag/derived/rng.hpp"

namespace redag::experiment {
namespace {

std::vector<double> one_to(int n) {
  std::vector<double> values(static_cast<std::size_t>(n));
  std::iota(values.begin(), values.end(), 1.0);
  return values;
}

// The ranks are from tables of the sign test (B. L. van der Parren, Statistica Neerlandica 24, 1970).
TEST(Median, IntervalsAreThoseOfTheTables) {
  const auto ranks = [](int n) { return std::pair(median_of(one_to(n)).low, median_of(one_to(n)).high); };
  EXPECT_EQ(ranks(6), std::pair(1.0, 6.0));
  EXPECT_EQ(ranks(9), std::pair(2.0, 8.0));
  EXPECT_EQ(ranks(20), std::pair(6.0, 15.0));
  EXPECT_EQ(ranks(50), std::pair(18.0, 33.0));
  EXPECT_NEAR(median_of(one_to(20)).confidence, 0.9586, 1e-4);
  EXPECT_EQ(median_of(one_to(20)).value, 10.5);
}

TEST(Median, ManyValuesHaveANarrowInterval) {
  // About n / 2 -+ 0.98 sqrt(n), by the normal approximation.
  for (const int n : {1074, 1075, 5000, 100'000}) {
    const Interval m = median_of(one_to(n));
    EXPECT_NEAR(m.low, n / 2.0 - 0.98 * std::sqrt(n), 2) << n;
    EXPECT_NEAR(m.high, n / 2.0 + 0.98 * std::sqrt(n), 2) << n;
    EXPECT_GE(m.confidence, 0.95) << n;
    EXPECT_LE(m.confidence, 0.96) << n;
  }
}

TEST(Median, FewValuesSayHowLittleTheyProve) {
  const Interval three = median_of({3, 1, 2});
  EXPECT_EQ(three.value, 2);
  EXPECT_EQ(three.low, 1);
  EXPECT_EQ(three.high, 3);
  EXPECT_NEAR(three.confidence, 0.75, 1e-12);
  EXPECT_EQ(median_of({7}).confidence, 0);
  EXPECT_EQ(median_of({7}).low, 7);
}

TEST(Median, CoversTheTrueMedianAsOftenAsItSays) {
  Rng rng(5);
  int covered = 0;
  constexpr int kTrials = 4000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> values;
    for (int i = 0; i < 15; ++i) {
      const double u = static_cast<double>(rng.uniform(0, 1'000'000)) / 1e6;
      values.push_back(u * u);  // skewed, with true median 0.25
    }
    const Interval m = median_of(values);
    if (m.low <= 0.25 && 0.25 <= m.high) ++covered;
  }
  EXPECT_NEAR(covered / double{kTrials}, median_of(one_to(15)).confidence, 0.01);
}

// Published values for 81 of 263, 15 of 148, 0 of 20 and 1 of 29: R. Newcombe, Statistics in Medicine 17(8), 1998,
// table I, method 3.
TEST(Proportion, PublishedIntervals) {
  const Interval a = proportion(81, 263);
  EXPECT_NEAR(a.low, 0.2553, 5e-5);
  EXPECT_NEAR(a.high, 0.3662, 5e-5);
  const Interval b = proportion(15, 148);
  EXPECT_NEAR(b.low, 0.0624, 5e-5);
  EXPECT_NEAR(b.high, 0.1605, 5e-5);
  const Interval c = proportion(0, 20);
  EXPECT_EQ(c.low, 0);
  EXPECT_NEAR(c.high, 0.1611, 5e-5);
  const Interval d = proportion(1, 29);
  EXPECT_NEAR(d.low, 0.0061, 5e-5);
  EXPECT_NEAR(d.high, 0.1718, 5e-5);
}

TEST(Proportion, Ends) {
  EXPECT_EQ(proportion(50, 50).high, 1);
  EXPECT_LT(proportion(50, 50).low, 1);
}

}  // namespace
}  // namespace redag::experiment
