// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/utilization.hpp"

#include <gtest/gtest.h>

#include <tuple>
#include <utility>
#include <vector>

#include "redag_analysis/core/exact_utilization.hpp"
#include "redag_analysis/one_worker/paper.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;
using testing::independent;
using testing::Load;

BoundCaseLimits rate_monotonic(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.min_deadline = 1.0;
  limits.max_deadline = 1.2;
  limits.min_utilization = 0.5;
  limits.overheads = true;
  return limits;
}

BoundCaseLimits with_blocking(sched::Preemption preemption) {
  BoundCaseLimits limits = rate_monotonic(preemption);
  limits.groups = limits.levels = limits.caps = true;
  limits.max_utilization = 0.9;
  limits.min_period = 10;
  limits.max_period = 100;
  return limits;
}

const testing::BoundPropertyOptions kFew{.workloads = 250};

TEST(BoundProperty, Hyperbolic) {
  expect_bound_holds(hyperbolic_blocking(), cases(rate_monotonic(sched::Preemption::Full)), kFew);
  BoundCaseLimits limits = rate_monotonic(sched::Preemption::Full);
  limits.edges = limits.caps = true;
  expect_bound_holds(hyperbolic_blocking(), cases(limits), kFew);
}

// Equals of one period, and of several.
TEST(BoundProperty, UtilizationOfEquals) {
  for (const sched::Preemption mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits = rate_monotonic(mode);
    limits.policies = {PolicyKind::Fixed};
    limits.max_dags = 3;
    limits.max_utilization = 0.9;
    expect_bound_holds(hyperbolic_blocking(), cases(limits), kFew);
  }
  BoundCaseLimits limits = rate_monotonic(sched::Preemption::Full);
  limits.policies = {PolicyKind::Fixed, PolicyKind::RateMonotonic};
  limits.min_workers = 2;
  limits.max_workers = 3;
  limits.max_dags = 6;
  limits.overheads = false;
  expect_bound_holds(global_rm_utilization(), cases(limits), kFew);
}

TEST(BoundProperty, BlockingPreemptive) {
  expect_bound_holds(hyperbolic_blocking(), cases(with_blocking(sched::Preemption::Full)), kFew);
}

TEST(BoundProperty, BlockingNonpreemptive) {
  BoundCaseLimits limits = with_blocking(sched::Preemption::None);
  limits.edges = true;
  expect_bound_holds(hyperbolic_blocking(), cases(limits), kFew);
}

TEST(BoundProperty, BlockingCooperative) {
  BoundCaseLimits limits = with_blocking(sched::Preemption::Cooperative);
  limits.groups = false;
  expect_bound_holds(hyperbolic_blocking(), cases(limits), kFew);
}

TEST(BoundProperty, GlobalRateMonotonic) {
  BoundCaseLimits limits = rate_monotonic(sched::Preemption::Full);
  limits.min_workers = 2;
  limits.max_workers = 4;
  limits.max_dags = 12;
  limits.min_utilization = 0.2;
  limits.max_utilization = 0.6;
  expect_bound_holds(global_rm_utilization(), cases(limits), kFew);
}

// ---- exactly at the limit, just below it and just above it ----

bool accepts(const Method &method, const Workload &workload) {
  const Outcome outcome = method.apply(testing::compiled(workload));
  const Bound *bound = std::get_if<Bound>(&outcome);
  return bound != nullptr && bound->accepts == true;
}

// (1 + 1/3) (1 + 1/5) (1 + 1/4) = 2; no share but the last is a multiple of a power of two.
TEST(ExactUtilization, HyperbolicAtTwo) {
  constexpr Duration kTick = 1'000'000'007;  // makes one nanosecond far smaller than the 2^-60 that rounding could
                                             // resolve
  const auto loads = [](Duration more) {
    return std::vector<Load>{{kTick, 3 * kTick}, {kTick, 4 * kTick}, {kTick + more, 5 * kTick}};
  };
  EXPECT_TRUE(accepts(hyperbolic_blocking(), independent(loads(0))));
  EXPECT_TRUE(accepts(hyperbolic_blocking(), independent(loads(-1))));
  EXPECT_FALSE(accepts(hyperbolic_blocking(), independent(loads(1))));
}

// One nanosecond beside periods so long that it is a fraction of 2^-60.
TEST(ExactUtilization, HyperbolicWithinTheLastBit) {
  constexpr Duration kLong = 3 * (Duration{1} << 56);
  // (1 + 1/3) (1 + 1/2) = 2.
  const auto loads = [](Duration more) {
    return std::vector<Load>{{kLong / 3 / 2, kLong / 2}, {kLong / 2 + more, kLong}};
  };
  EXPECT_TRUE(accepts(hyperbolic_blocking(), independent(loads(0))));
  EXPECT_TRUE(accepts(hyperbolic_blocking(), independent(loads(-1))));
  EXPECT_FALSE(accepts(hyperbolic_blocking(), independent(loads(1))));
}

TEST(ExactUtilization, OneWhole) {
  EXPECT_TRUE(accepts(paper_rm_bound(), independent({{7, 7}})));
  EXPECT_TRUE(accepts(hyperbolic_blocking(), independent({{7, 7}})));
}

// The limit of two tasks is 2 sqrt(2) - 2. The test takes the nearest fractions on both sides, from the continued
// fraction of sqrt(2).
TEST(ExactUtilization, LiuLaylandBesideAnIrrationalLimit) {
  // p / q is below sqrt(2) or above it, with p^2 - 2 q^2 = -1 or 1.
  Int128 p = 1;
  Int128 q = 1;
  int below = 0;
  int above = 0;
  for (; q < Int128{1} << 58; std::tie(p, q) = std::pair(p + 2 * q, p + q)) {
    if (q < 1000) continue;
    // U = 2 p / q - 2, as two equal shares of p / q - 1.
    const auto wcet = static_cast<Duration>(p - q);
    const auto period = static_cast<Duration>(q);
    const bool is_below = p * p < 2 * q * q;
    EXPECT_EQ(accepts(paper_rm_bound(), independent({{wcet, period}, {wcet, period}})), is_below) << period;
    ++(is_below ? below : above);
  }
  EXPECT_GT(below, 10);
  EXPECT_GT(above, 10);
}

TEST(ExactUtilization, SeveralWorkers) {
  // m = 2: U <= 1 for any u; m = 3: U <= 3/2 - u/2.
  EXPECT_TRUE(accepts(global_rm_utilization(), independent({{1, 3}, {2, 6}, {4, 12}}, 2)));
  EXPECT_FALSE(accepts(global_rm_utilization(), independent({{1, 3}, {2, 6}, {5, 12}}, 2)));
  const std::vector<Load> three = {{1, 3}, {2, 6}, {3, 9}, {4, 12}};  // U = 4/3 = 3/2 - 1/6
  EXPECT_TRUE(accepts(global_rm_utilization(), independent(three, 3)));
  std::vector<Load> more = three;
  more.back().wcet = 5;
  EXPECT_FALSE(accepts(global_rm_utilization(), independent(more, 3)));
}

// Compares plain exact arithmetic with the arithmetic of the bounds.
TEST(ExactUtilization, AsLongDivisionSays) {
  Rng rng(7);
  std::uint32_t equal = 0;
  for (int i = 0; i < 20'000; ++i) {
    Shares shares;
    Int128 numerator = 0;
    constexpr Duration kAll = Duration{4} * 9 * 5 * 7;
    for (Duration left = rng.uniform(1, 4); left > 0; --left) {
      const Duration periods[] = {3, 4, 5, 6, 7, 9, 10, 12, 14, 15, 20, 21};
      const Duration period = periods[rng.uniform(0, 11)];
      const Duration amount = rng.uniform(0, period);
      shares.push({static_cast<Uint128>(amount), period});
      numerator += Int128{amount} * (kAll / period);
    }
    const auto of = static_cast<std::uint64_t>(rng.uniform(1, 12));
    const auto limit = static_cast<std::uint64_t>(rng.uniform(1, 20));
    const Int128 left = numerator * static_cast<Int128>(of);
    const Int128 right = static_cast<Int128>(limit) * kAll;
    ASSERT_EQ(is_sum_within(shares, limit, of), left <= right);
    equal += left == right ? 1U : 0U;
  }
  EXPECT_GT(equal, 100U);
}

}  // namespace
}  // namespace redag::analysis
