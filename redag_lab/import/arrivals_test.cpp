// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "redag_lab/import/model.hpp"

namespace redag::lab {
namespace {

using ::testing::HasSubstr;

constexpr Time kMs = kMillisecond;

TEST(Arrivals, OfALossyBus) {
  std::vector<Time> instants;
  for (Time k = 0; k < 200; ++k) {
    if (k % 10 != 3) instants.push_back(k * 5 * kMs + (k % 3) * 20'000);
  }
  const Arrivals arrivals = estimate_arrivals(instants);
  EXPECT_EQ(arrivals.period, 5 * kMs);
  EXPECT_FALSE(arrivals.sporadic);
  EXPECT_NEAR(static_cast<double>(arrivals.jitter), 40'000, 1000);
  EXPECT_THAT(arrivals.note, HasSubstr("20 of 200 did not come"));
}

// A late sender catches up at once, or leaves instants out.
TEST(Arrivals, OfALateSender) {
  std::vector<Time> instants;
  for (Time k = 0; k < 200; ++k) {
    if (k == 50) instants.push_back(k * 5 * kMs + 4'500'000);
    if (k == 100) instants.push_back((k + 1) * 5 * kMs + 100'000);
    if (k == 150 || k == 151) continue;
    if (k % 50 != 0) instants.push_back(k * 5 * kMs);
  }
  const Arrivals arrivals = estimate_arrivals(instants);
  EXPECT_EQ(arrivals.period, 5 * kMs);
  EXPECT_NEAR(static_cast<double>(arrivals.jitter), 5 * kMs, 10'000);  // 5.1 ms late
  EXPECT_THAT(arrivals.note, HasSubstr("2 of 199 did not come"));
}

// Most intervals are longer than the period.
TEST(Arrivals, WhoseMedianIsFarFromThePeriod) {
  std::vector<Time> instants;
  for (Time k = 0; k < 4000; ++k) instants.push_back(k * 5 * kMs + (k % 5) * 200'000);
  const Arrivals arrivals = estimate_arrivals(instants);
  EXPECT_EQ(arrivals.period, 5 * kMs);
  EXPECT_NEAR(static_cast<double>(arrivals.jitter), 800'000, 10'000);
  EXPECT_EQ(arrivals.note, "");
}

TEST(Arrivals, OfBursts) {
  std::vector<Time> instants;
  for (Time k = 0; k < 100; ++k) {
    for (const Time at : {0, 10'000, 70'000}) instants.push_back(k * 100 * kMs + at);
  }
  const Arrivals arrivals = estimate_arrivals(instants);
  EXPECT_NEAR(static_cast<double>(arrivals.period), 100.0 / 3 * kMs, kMs);
  EXPECT_EQ(arrivals.jitter, arrivals.period);
  EXPECT_THAT(arrivals.note, HasSubstr("unknown"));
}

TEST(Arrivals, AtOneInstant) { EXPECT_EQ(estimate_arrivals({5, 5, 5}).period, 1); }

}  // namespace
}  // namespace redag::lab
