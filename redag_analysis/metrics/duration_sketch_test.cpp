// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/duration_sketch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace redag::metrics {
namespace {

void expect_close(const Distribution &found, const Distribution &exact) {
  EXPECT_EQ(found.count, exact.count);
  EXPECT_NEAR(found.mean, exact.mean, 1e-9 * exact.mean);
  EXPECT_EQ(found.min, exact.min);
  EXPECT_EQ(found.max, exact.max);
  for (const auto percentile : {&Distribution::p50, &Distribution::p90, &Distribution::p95, &Distribution::p99}) {
    const auto value = static_cast<double>(exact.*percentile);
    EXPECT_NEAR(static_cast<double>(found.*percentile), value, value * found.percentile_error);
  }
}

// Durations from nanoseconds to minutes.
std::vector<Duration> random_durations(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Duration> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<Duration>(random() >> (28 + random() % 36)));
  return values;
}

TEST(DurationSketch, IsExactUpToItsLimit) {
  const std::vector<Duration> values = random_durations(500, 3);
  DurationSketch sketch(500);
  for (const Duration value : values) sketch.add(value);
  EXPECT_TRUE(sketch.is_exact());
  EXPECT_EQ(sketch.distribution(), distribution_of(values));
  sketch.add(7);
  EXPECT_FALSE(sketch.is_exact());
}

TEST(DurationSketch, BeyondItsLimitIsWithinTheStatedError) {
  for (const std::size_t count : {2U, 3U, 100U, 50'000U}) {
    std::vector<Duration> values = random_durations(count, count);
    DurationSketch sketch(1);
    for (const Duration value : values) sketch.add(value);
    const Distribution found = sketch.distribution();
    EXPECT_EQ(found.percentile_error, 1.0 / 256);
    expect_close(found, distribution_of(std::move(values)));
  }
}

TEST(DurationSketch, SmallNumbersOfNanosecondsAreExact) {
  DurationSketch sketch(1);
  std::vector<Duration> values;
  for (Duration value = 0; value < 256; ++value) {
    sketch.add(value);
    values.push_back(value);
  }
  Distribution found = sketch.distribution();
  found.percentile_error = 0;
  EXPECT_EQ(found, distribution_of(values));
}

TEST(DurationSketch, HoldsTheExtremes) {
  DurationSketch sketch(0);
  sketch.add(-5);
  sketch.add(kNever);
  sketch.add(kNever - 1);
  const Distribution found = sketch.distribution();
  EXPECT_EQ(found.min, -5);
  EXPECT_EQ(found.max, kNever);
  EXPECT_GE(found.p50, kNever - kNever / 256);
  EXPECT_LE(found.p99, kNever);
}

TEST(DurationSketch, PartsMergeToTheWhole) {
  const std::vector<Duration> values = random_durations(10'000, 5);
  for (const std::size_t limit : {0U, 1000U, 3000U, 20'000U}) {
    DurationSketch whole(limit);
    std::vector<DurationSketch> parts(4, DurationSketch(limit));
    for (std::size_t i = 0; i < values.size(); ++i) {
      whole.add(values[i]);
      parts[i % 7 == 0 ? 3 : i % 3].add(values[i]);
    }
    DurationSketch merged(limit);
    for (const DurationSketch &part : parts) merged.merge(part);
    // A whole of exact parts stays exact, even beyond the limit of a single sketch.
    if (merged.is_exact() == whole.is_exact()) {
      EXPECT_EQ(merged.distribution(), whole.distribution()) << limit;
    }
    expect_close(merged.distribution(), distribution_of(values));
  }
}

// A long run costs only the buckets that its values fall into.
TEST(DurationSketch, MemoryDoesNotGrowWithTheNumberOfValues) {
  DurationSketch sketch(1000);
  const auto add = [&sketch](std::size_t count, std::uint64_t seed) {
    for (const Duration value : random_durations(count, seed)) sketch.add(value);
  };
  add(100'000, 1);
  const std::size_t before = sketch.memory();
  EXPECT_LT(before, 100'000U);
  for (std::uint64_t round = 2; round < 12; ++round) add(100'000, round);
  EXPECT_LE(sketch.memory(), 2 * before);
  EXPECT_EQ(sketch.distribution().count, 1'100'000U);
}

}  // namespace
}  // namespace redag::metrics
