// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/median.hpp"

#include <gtest/gtest.h>
#include <cmath>

#include <numeric>

#include "redag/base/rng.hpp"

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
  EXPECT_EQ(median_of(one_to(20)).median, 10.5);
}

TEST(Median, ManyValuesHaveANarrowInterval) {
  // About n / 2 -+ 0.98 sqrt(n), by the normal approximation.
  for (const int n : {1074, 1075, 5000, 100'000}) {
    const Median m = median_of(one_to(n));
    EXPECT_NEAR(m.low, n / 2.0 - 0.98 * std::sqrt(n), 2) << n;
    EXPECT_NEAR(m.high, n / 2.0 + 0.98 * std::sqrt(n), 2) << n;
    EXPECT_GE(m.confidence, 0.95) << n;
    EXPECT_LE(m.confidence, 0.96) << n;
  }
}

TEST(Median, FewValuesSayHowLittleTheyProve) {
  const Median three = median_of({3, 1, 2});
  EXPECT_EQ(three.median, 2);
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
    const Median m = median_of(values);
    if (m.low <= 0.25 && 0.25 <= m.high) ++covered;
  }
  EXPECT_NEAR(covered / double{kTrials}, median_of(one_to(15)).confidence, 0.01);
}

}  // namespace
}  // namespace redag::experiment
