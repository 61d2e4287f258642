// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/rng.hpp"

#include <array>
#include <limits>
#include <set>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

namespace redag {
namespace {

// The first outputs of the published splitmix64.c for seed 0; mix() is one step of it.
TEST(Mix, IsSplitMix64) {
  EXPECT_EQ(mix(0), 0xe220a8397b1dcdafULL);
  EXPECT_EQ(mix(0x9e3779b97f4a7c15ULL), 0x6e789e6aa1b965f4ULL);
}

// The published xoshiro256plusplus.c, in full, as the oracle.
std::uint64_t reference_next(std::array<std::uint64_t, 4> &s) {
  const auto rotl = [](std::uint64_t x, int k) { return (x << k) | (x >> (64 - k)); };
  const std::uint64_t result = rotl(s[0] + s[3], 23) + s[0];
  const std::uint64_t t = s[1] << 17;
  s[2] ^= s[0];
  s[3] ^= s[1];
  s[1] ^= s[2];
  s[0] ^= s[3];
  s[2] ^= t;
  s[3] = rotl(s[3], 45);
  return result;
}

RC_GTEST_PROP(Rng, IsXoshiro256PlusPlus, (std::uint64_t seed)) {
  std::array<std::uint64_t, 4> state{};
  for (std::uint64_t i = 0; i < 4; ++i) state[i] = mix(seed + i * 0x9e3779b97f4a7c15ULL);
  Rng rng(seed);
  for (int i = 0; i < 20; ++i) RC_ASSERT(rng() == reference_next(state));
}

RC_GTEST_PROP(Rng, UniformStaysInItsRange, (std::uint64_t seed, std::int64_t a, std::int64_t b)) {
  const auto [low, high] = std::minmax(a, b);
  Rng rng(seed);
  for (int i = 0; i < 20; ++i) {
    const std::int64_t x = rng.uniform(low, high);
    RC_ASSERT(x >= low && x <= high);
  }
}

TEST(Rng, UniformTakesTheWholeRangeOfInt64) {
  Rng rng(1);
  bool negative = false;
  bool positive = false;
  for (int i = 0; i < 100; ++i) {
    const std::int64_t x =
        rng.uniform(std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
    negative = negative || x < 0;
    positive = positive || x > 0;
  }
  EXPECT_TRUE(negative && positive);
}

TEST(Rng, UniformIsEven) {
  std::array<int, 6> counts{};
  Rng rng(7);
  constexpr int kDraws = 60'000;
  for (int i = 0; i < kDraws; ++i) ++counts[static_cast<std::size_t>(rng.uniform(0, 5))];
  // Chi-square with 5 degrees of freedom: 20.5 has probability 0.001. The seed is fixed.
  double chi = 0;
  for (const int n : counts) chi += (n - 10'000.0) * (n - 10'000.0) / 10'000.0;
  EXPECT_LT(chi, 20.5);
}

TEST(Rng, NormalHasItsMoments) {
  Rng rng(3);
  constexpr int kDraws = 100'000;
  double sum = 0;
  double squares = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.normal();
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / kDraws, 0.0, 0.02);
  EXPECT_NEAR(squares / kDraws, 1.0, 0.03);
}

TEST(Rng, StreamsDiffer) {
  std::set<std::uint64_t> firsts;
  for (std::uint64_t stream = 0; stream < 50; ++stream) {
    for (std::uint64_t index = 0; index < 50; ++index) firsts.insert(Rng::stream(1, stream, index)());
  }
  EXPECT_EQ(firsts.size(), 2500U);
}

}  // namespace
}  // namespace redag
