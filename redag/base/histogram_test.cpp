// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <thread>
#include <vector>

namespace redag {
namespace {

TEST(Histogram, PercentilesAreAtMostAnEighthTooLarge) {
  std::mt19937_64 random(11);
  Histogram histogram;
  std::vector<Duration> values;
  EXPECT_EQ(histogram.quantile(0.5), 0);
  for (int i = 0; i < 20'000; ++i) {
    const auto value = static_cast<Duration>(random() >> (24 + random() % 36));
    values.push_back(value);
    histogram.add(value);
  }
  std::sort(values.begin(), values.end());
  for (const double share : {0.01, 0.5, 0.9, 0.99, 0.999}) {
    const Duration exact = values[static_cast<std::size_t>(share * static_cast<double>(values.size())) - 1];
    const Duration found = histogram.quantile(share);
    EXPECT_GE(found, exact) << share;
    EXPECT_LE(static_cast<double>(found), static_cast<double>(exact) * 1.125 + 1) << share;
  }
  EXPECT_EQ(histogram.longest(), values.back());
  EXPECT_EQ(histogram.quantile(1.0), values.back());
}

TEST(Histogram, AQuantileIsNeverBelowTheShareOfFewValues) {
  for (int count = 1; count <= 200; ++count) {
    Histogram histogram;
    for (int value = 1; value <= count; ++value) histogram.add(value * kMillisecond);
    EXPECT_EQ(histogram.quantile(1), count * kMillisecond);
    for (const int percent : {1, 7, 50, 90, 99}) {
      const int rank = (percent * count + 99) / 100;
      EXPECT_GE(histogram.quantile(percent / 100.0), rank * kMillisecond) << percent << " % of " << count;
      EXPECT_LE(histogram.quantile(percent / 100.0), rank * kMillisecond * 9 / 8 + 1) << percent << " % of " << count;
    }
  }
}

TEST(Histogram, CountsSubtractToWhatCameBetween) {
  Histogram histogram;
  for (int i = 0; i < 1000; ++i) histogram.add(kSecond);
  HistogramCounts before = histogram.counts();
  for (int i = 0; i < 10; ++i) histogram.add(kMillisecond);
  HistogramCounts recent = histogram.counts();
  recent -= before;
  EXPECT_EQ(recent.total(), 10U);
  EXPECT_GE(recent.quantile(1.0), kMillisecond);
  EXPECT_LE(recent.quantile(1.0), kMillisecond * 9 / 8 + 1);
  EXPECT_EQ(recent.longest(), kSecond);
  before += recent;
  EXPECT_EQ(before.total(), 1010U);
  EXPECT_EQ(before.quantile(1.0), kSecond);
}

TEST(Histogram, WhatIsLongerThanAllBucketsIsNotMadeShorter) {
  Histogram histogram;
  histogram.add(kNever - 1);
  EXPECT_EQ(histogram.quantile(1.0), kNever - 1);
}

// 1 kHz for seven weeks.
TEST(Histogram, CountsGoBeyondThirtyTwoBits) {
  Histogram histogram;
  histogram.add(10 * kMicrosecond);
  HistogramCounts counts = histogram.counts();
  for (int doubled = 0; doubled < 33; ++doubled) counts += counts;
  EXPECT_EQ(counts.total(), std::uint64_t{1} << 33U);
  EXPECT_LE(counts.quantile(0.5), 10 * kMicrosecond);
}

TEST(Histogram, ManyThreadsLoseNothing) {
  Histogram histogram;
  constexpr int kEach = 20'000;
  const auto add = [&](Duration first) {
    for (int i = 0; i < kEach; ++i) histogram.add(first + i);
  };
  std::thread other(add, 1000);
  std::thread reader([&] {
    for (int i = 0; i < 100; ++i) {
      const HistogramCounts counts = histogram.counts();
      EXPECT_LE(counts.quantile(0.99), counts.longest());
      EXPECT_EQ(counts.total() > 0, counts.quantile(0.5) > 0);
    }
  });
  add(1);
  other.join();
  reader.join();
  EXPECT_EQ(histogram.counts().total(), 2U * kEach);
  EXPECT_EQ(histogram.longest(), 1000 + kEach - 1);
}

}  // namespace
}  // namespace redag
