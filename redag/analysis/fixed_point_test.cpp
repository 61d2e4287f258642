#include "redag/analysis/fixed_point.hpp"

#include <gtest/gtest.h>

#include <array>

namespace redag::analysis::global {
namespace {

constexpr std::string_view kExceeds = "too large";

// Two values, each a function of both.
struct Two {
  std::array<Duration, 2> values{};
  Duration limit = 0;
  int evaluations = 0;

  template <class Next>
  std::string_view agree(Next next) {
    const std::array<Reliant, 2> reliant = {Reliant{values.data(), limit}, Reliant{values.data() + 1, limit}};
    return global::agree(reliant, kExceeds, [&](std::size_t k) {
      ++evaluations;
      values[k] = next(k, values);
      return values[k] <= limit;
    });
  }
};

TEST(LeastFixedPoint, IsTheLeast) {
  const auto next = [](Duration x) { return x < 7 ? x + 2 : x < 20 ? Duration{8} : x; };
  Duration value = 0;
  EXPECT_TRUE(least_fixed_point(100, value, next));
  EXPECT_EQ(value, 8);
  value = 0;
  EXPECT_FALSE(least_fixed_point(7, value, next));
}

TEST(Agree, FindsTheLeast) {
  Two two{{1, 1}, 100};
  // x = 3 + y / 2, y = 4 + x / 3; also much larger ones would do.
  EXPECT_TRUE(two.agree([](std::size_t k, const auto &v) { return k == 0 ? 3 + v[1] / 2 : 4 + v[0] / 3; }).empty());
  EXPECT_EQ(two.values, (std::array<Duration, 2>{5, 5}));
  EXPECT_LT(two.evaluations, 20);
}

TEST(Agree, SaysThatALimitIsExceeded) {
  Two two{{1, 1}, 4};
  EXPECT_EQ(two.agree([](std::size_t k, const auto &v) { return k == 0 ? 3 + v[1] / 2 : 4 + v[0] / 3; }), kExceeds);
}

// A thousandth of the way is left after a thousand times as many steps as are allowed.
Duration creep(Duration x, Duration goal) { return x < goal ? x + (goal - x + 9999) / 10000 : x - (x - goal) / 10000; }

TEST(Agree, WhatCreepsIsGuessed) {
  constexpr Duration kGoal = 1'000'000'000;
  for (const Duration start : {Duration{0}, kGoal / 2, kGoal - 100'000}) {
    Two two{{start, start}, 2 * kGoal};
    const auto next = [](std::size_t k, const auto &v) { return k == 0 ? creep(v[1], kGoal) : v[0]; };
    EXPECT_TRUE(two.agree(next).empty());
    // What is found agrees, and has not gone far beyond the least.
    EXPECT_GE(two.values[0], next(0, two.values));
    EXPECT_GE(two.values[1], next(1, two.values));
    EXPECT_GE(two.values[0], kGoal);
    EXPECT_LE(two.values[0] - kGoal, kGoal - start);
    EXPECT_LT(two.evaluations, 5000);
  }
}

TEST(Agree, WhatCreepsTowardsMoreThanItsLimitIsGivenUp) {
  constexpr Duration kGoal = 1'000'000'000;
  Two two{{0, 0}, kGoal - 1};
  const auto reason = two.agree([](std::size_t k, const auto &v) { return k == 0 ? creep(v[1], kGoal) : v[0]; });
  EXPECT_TRUE(reason.starts_with("gave up")) << reason;
}

}  // namespace
}  // namespace redag::analysis::global
