// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/fixed_point.hpp"

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
    const std::array<Duration *, 2> all = {values.data(), values.data() + 1};
    return global::agree(all, kExceeds, [&](std::size_t k) {
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

// A function that grows by a nanosecond a step up to a distant goal. Beyond the goal it has steps, each a fixed point
// at its top.
TEST(LeastFixedPoint, IsFoundFarAwayInFewSteps) {
  for (const Duration goal : {Duration{20'000}, kMillisecond, kSecond}) {
    int calls = 0;
    Duration last = 0;
    const auto next = [&](Duration x) {
      ++calls;
      last = x;
      return x < goal ? x + 1 : goal + (x - goal) / 1000 * 1000;
    };
    Duration value = 5;
    EXPECT_TRUE(least_fixed_point(2 * goal, value, next));
    EXPECT_EQ(last, value);  // the side effects are those of the value found
    EXPECT_EQ(next(value), value);
    EXPECT_GE(value, goal);
    EXPECT_LT(calls, 11'000);
    value = 5;
    EXPECT_FALSE(least_fixed_point(goal - 1, value, next));
    value = 5;
    EXPECT_TRUE(least_fixed_point(goal, value, next));
    EXPECT_EQ(value, goal);
  }
}

TEST(Agree, FindsTheLeast) {
  Two two{{1, 1}, 100};
  // x = 3 + y / 2, y = 4 + x / 3; much larger values would agree, too.
  EXPECT_TRUE(two.agree([](std::size_t k, const auto &v) { return k == 0 ? 3 + v[1] / 2 : 4 + v[0] / 3; }).empty());
  EXPECT_EQ(two.values, (std::array<Duration, 2>{5, 5}));
  EXPECT_LT(two.evaluations, 20);
}

TEST(Agree, SaysThatALimitIsExceeded) {
  Two two{{1, 1}, 4};
  EXPECT_EQ(two.agree([](std::size_t k, const auto &v) { return k == 0 ? 3 + v[1] / 2 : 4 + v[0] / 3; }), kExceeds);
}

TEST(Agree, GivesUpInTheEnd) {
  Two two{{1, 1}, kSecond};
  const auto reason = two.agree([](std::size_t, const auto &v) { return v[0] + v[1]; });
  EXPECT_EQ(reason, kExceeds);
  two = {{1, 1}, kSecond};
  const auto creeping = two.agree([](std::size_t k, const auto &v) { return k == 0 ? v[1] + 1 : v[0]; });
  EXPECT_TRUE(creeping.starts_with("gave up")) << creeping;
  EXPECT_LT(two.evaluations, 5000);
}

}  // namespace
}  // namespace redag::analysis::global
