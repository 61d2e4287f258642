// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/block_bootstrap.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "redag/base/rng.hpp"

namespace redag::lab {
namespace {

// Jobs of a run in which misses come in bursts: after a missed job the next one is likely to miss, too.
struct Bursts {
  double begin = 0.005;  // probability that a burst begins
  double end = 0.05;     // probability that it ends: 20 jobs on average
  Duration slow = 0;     // added to every response
};

std::vector<Block> bursty_run(const Bursts &bursts, std::uint64_t seed, std::size_t blocks = 30,
                              std::size_t jobs = 100) {
  Rng rng(seed);
  std::vector<Block> run(blocks);
  bool burst = rng.uniform01() < bursts.begin / (bursts.begin + bursts.end);
  for (Block &block : run) {
    for (std::size_t i = 0; i < jobs; ++i) {
      if (rng.uniform01() < (burst ? bursts.end : bursts.begin)) burst = !burst;
      ++block.released;
      if (burst) ++block.missed;
      block.responses.push_back(bursts.slow + 1000 + rng.uniform(0, 400) + (burst ? 2000 : 0));
    }
  }
  return run;
}

BlockedRuns runs(const Bursts &bursts, std::uint64_t seed, std::size_t count = 1) {
  BlockedRuns result;
  for (std::size_t i = 0; i < count; ++i) result.push_back(bursty_run(bursts, mix(seed ^ mix(i))));
  return result;
}

BootstrapOptions quick() {
  BootstrapOptions options;
  options.replicates = 200;
  options.tolerance = 0;
  return options;
}

// A two-sided normal test of two proportions that takes jobs for independent: the mistake that the bootstrap avoids.
double naive_p(const BlockedRuns &a, const BlockedRuns &b) {
  const auto counts = [](const BlockedRuns &side) {
    std::pair<double, double> sum{0, 0};
    for (const auto &run : side) {
      for (const Block &block : run) {
        sum.first += static_cast<double>(block.missed);
        sum.second += static_cast<double>(block.released);
      }
    }
    return sum;
  };
  const auto [missed_a, n_a] = counts(a);
  const auto [missed_b, n_b] = counts(b);
  const double p = (missed_a + missed_b) / (n_a + n_b);
  const double z = (missed_a / n_a - missed_b / n_b) / std::sqrt(p * (1 - p) * (1 / n_a + 1 / n_b));
  return std::erfc(std::abs(z) / std::sqrt(2.0));
}

TEST(BlockBootstrap, OfTheSameThingFindsDifferencesAboutAsOftenAsItSays) {
  int naive = 0;
  int misses = 0;
  int tails = 0;
  constexpr int kTrials = 200;
  for (int i = 0; i < kTrials; ++i) {
    const BlockedRuns a = runs({}, mix(static_cast<std::uint64_t>(2 * i)));
    const BlockedRuns b = runs({}, mix(static_cast<std::uint64_t>(2 * i + 1)));
    const RowDifference row = compare_blocks(a, b, quick());
    misses += row.miss_ratio.p() <= 0.05 ? 1 : 0;
    tails += row.p95.p() <= 0.05 ? 1 : 0;
    naive += naive_p(a, b) <= 0.05 ? 1 : 0;
  }
  EXPECT_GT(naive, kTrials / 2) << "the bursts are too short to show anything";
  // The nominal rate is 5 %; thirty blocks with three short bursts each give 9 %.
  EXPECT_LE(misses, kTrials * 15 / 100);
  EXPECT_LE(tails, kTrials * 15 / 100);
  EXPECT_GE(misses, 2) << "a test that never speaks";
}

TEST(BlockBootstrap, FindsWhatIsThere) {
  int fewer = 0;
  int slower = 0;
  constexpr int kTrials = 20;
  for (int i = 0; i < kTrials; ++i) {
    const BlockedRuns a = runs({}, mix(static_cast<std::uint64_t>(i)), 3);
    const BlockedRuns b = runs({0.0005, 0.05, 200}, mix(static_cast<std::uint64_t>(1000 + i)), 3);
    const RowDifference row = compare_blocks(a, b, quick());
    fewer += row.miss_ratio.p() <= 0.05 && row.miss_ratio.p_less < row.miss_ratio.p_more ? 1 : 0;
    slower += row.p50.p() <= 0.05 && row.p50.p_more < row.p50.p_less ? 1 : 0;
  }
  EXPECT_GE(fewer, kTrials * 8 / 10);
  EXPECT_GE(slower, kTrials * 9 / 10);
}

TEST(BlockBootstrap, OneBurstIsOneEvent) {
  BlockedRuns a = {std::vector<Block>(30, Block{100, 0, {}})};
  BlockedRuns b = a;
  b[0][7].missed = 60;  // of 3000 jobs against none: Fisher's exact test says p < 1e-17
  EXPECT_GT(compare_blocks(a, b, quick()).miss_ratio.p(), 0.5);
  for (std::size_t i = 0; i < 20; ++i) b[0][i].missed = 3;
  EXPECT_LT(compare_blocks(a, b, quick()).miss_ratio.p(), 0.01);
}

TEST(BlockBootstrap, WhatDiffersFromRunToRunIsNoDifferenceOfTheSides) {
  // Both sides have fast and slow runs; within a run nothing varies.
  const auto flat = [](Duration response) {
    return std::vector<Block>(30, Block{1, 0, std::vector<Duration>(50, response)});
  };
  const BlockedRuns a = {flat(100), flat(200), flat(300)};
  const BlockedRuns b = {flat(130), flat(230), flat(330)};
  EXPECT_GT(compare_blocks(a, b, quick()).p50.p(), 0.2);
  EXPECT_LT(compare_blocks({flat(100)}, {flat(130)}, quick()).p50.p(), 0.01);
}

TEST(BlockBootstrap, FiguresAreExact) {
  Block block{10, 1, {}};
  for (Duration i = 1; i <= 100; ++i) block.responses.push_back(i);
  const RowDifference row = compare_blocks({std::vector<Block>(20, block)}, {std::vector<Block>(20, block)}, quick());
  EXPECT_EQ(row.miss_ratio.a, 0.1);
  EXPECT_EQ(row.p50.a, 50);
  EXPECT_EQ(row.p95.b, 95);
  EXPECT_EQ(row.p99.b, 99);
  EXPECT_EQ(row.p99.low, 0);
  EXPECT_EQ(row.p99.high, 0);
  EXPECT_EQ(row.p50.p(), 1);
}

TEST(BlockBootstrap, TheToleranceIsNoDifference) {
  const auto flat = [](Duration response) {
    return std::vector<Block>(30, Block{50, 0, std::vector<Duration>(50, response)});
  };
  BootstrapOptions options = quick();
  EXPECT_LT(compare_blocks({flat(100)}, {flat(104)}, options).p50.p(), 0.01);
  options.tolerance = 0.05;
  EXPECT_EQ(compare_blocks({flat(100)}, {flat(104)}, options).p50.p(), 1);
  EXPECT_LT(compare_blocks({flat(100)}, {flat(106)}, options).p50.p(), 0.01);
  EXPECT_LT(compare_blocks({flat(100)}, {flat(94)}, options).p50.p(), 0.01);
}

TEST(BlockBootstrap, TooFewAreNotTested) {
  const std::vector<Block> few(7, Block{10, 5, std::vector<Duration>(10, 1)});
  EXPECT_FALSE(compare_blocks({few}, {few}, quick()).miss_ratio.tested);
  const std::vector<Block> some(20, Block{10, 5, std::vector<Duration>(10, 1)});
  const RowDifference row = compare_blocks({some}, {some}, quick());
  EXPECT_TRUE(row.miss_ratio.tested);
  EXPECT_TRUE(row.p95.tested);
  EXPECT_FALSE(row.p99.tested);  // 2 jobs beyond it
}

TEST(BlockBootstrap, LongMemoryShows) {
  // The bursts last longer than the blocks.
  const BlockedRuns slow = {bursty_run({0.002, 0.002, 0}, 5, 60, 50)};
  const RowDifference row = compare_blocks(slow, slow, quick());
  EXPECT_GT(row.block_correlation, row.correlation_limit);
  const RowDifference fine = compare_blocks(runs({}, 3), runs({}, 4), quick());
  EXPECT_LT(fine.block_correlation, fine.correlation_limit);
}

TEST(BlockBootstrap, IsDeterministic) {
  const RowDifference first = compare_blocks(runs({}, 3), runs({}, 4), quick());
  const RowDifference second = compare_blocks(runs({}, 3), runs({}, 4), quick());
  EXPECT_EQ(first.p95.low, second.p95.low);
  EXPECT_EQ(first.miss_ratio.p_more, second.miss_ratio.p_more);
}

TEST(DiscoveryThreshold, IsThatOfBenjaminiAndHochberg) {
  EXPECT_EQ(discovery_threshold({}), 0);
  EXPECT_EQ(discovery_threshold({0.06, 0.5}), 0);
  EXPECT_EQ(discovery_threshold({0.04, 0.5}), 0);  // a discovery would need 0.025
  EXPECT_EQ(discovery_threshold({0.5, 0.01, 0.03}), 0.03);
  EXPECT_EQ(discovery_threshold({0.05, 0.05, 0.05}), 0.05);
}

}  // namespace
}  // namespace redag::lab
