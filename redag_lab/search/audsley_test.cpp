// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/audsley.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "redag_analysis/analyze/analyze.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::lab {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::independent;

// Every unit's response under the order-free test fits its deadline, and the largest lateness.
struct UnderTest {
  bool all_fit = true;
  Duration worst = std::numeric_limits<Duration>::min();
};
UnderTest under(const OrderFreeTest &test, const BoundCase &bound_case, const analysis::TaskSet &task_set,
                const UnitOrder &order) {
  UnderTest result;
  const analysis::TaskSet ordered =
      analysis::compile(with_order(bound_case.workload, task_set, order), bound_case.platform).value();
  for (const std::uint32_t unit : order) {
    const Duration due = std::min(task_set.units[unit].deadline, task_set.units[unit].limit);
    const std::optional<Duration> response = test.response(ordered, unit);
    result.all_fit = result.all_fit && response && *response <= due;
    result.worst = std::max(result.worst, response ? *response - due : kMaxDuration);
  }
  return result;
}

// Checks tests that are marked optimal for Audsley's assignment: no order of all n! is better. A found order must also
// be schedulable by analyze().
void expect_optimal(BoundCaseLimits limits) {
  limits.max_dags = 4;
  limits.min_utilization = limits.max_workers > 1 ? 0.2 : 0.6;
  limits.policies = {PolicyKind::RateMonotonic};
  const auto cases = static_cast<int>(testing::how_many(150));
  int tried = 0;
  int found_some = 0;
  for (int i = 0; i < cases; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 31));
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    const analysis::TaskSet task_set = analysis::compile(bound_case.workload, bound_case.platform).value();
    const TestChoice choice = order_free_test(bound_case.workload, bound_case.platform);
    if (!choice.test || task_set.units.size() > 5) continue;
    ASSERT_TRUE(choice.test->optimal);
    SCOPED_TRACE(describe(bound_case));
    const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
    const auto found = audsley(bound_case.workload, bound_case.platform, *choice.test, all_orders(task_set), lateness);
    ASSERT_TRUE(found);
    const UnderTest best = under(*choice.test, bound_case, task_set, found->order);
    ASSERT_EQ(best.all_fit, !found->failure);
    ++tried;
    UnitOrder order(task_set.units.size());
    std::iota(order.begin(), order.end(), 0);
    do {
      const UnderTest other = under(*choice.test, bound_case, task_set, order);
      ASSERT_LE(best.worst, other.worst);
      ASSERT_TRUE(!found->failure || !other.all_fit);
    } while (std::next_permutation(order.begin(), order.end()));
    if (found->failure) continue;
    ++found_some;
    const analysis::TaskSet ordered =
        analysis::compile(with_order(bound_case.workload, task_set, found->order), bound_case.platform).value();
    ASSERT_EQ(analysis::analyze(ordered).verdict, analysis::Verdict::Schedulable);
  }
  EXPECT_GT(tried, cases / 4);
  EXPECT_GT(found_some, cases / 20);
  EXPECT_LT(found_some, tried);
}

// True if the order has the units of each chain in the chain's order, and begins with `first`.
bool is_among(const Orders &orders, const UnitOrder &order) {
  const auto place = [&](std::uint32_t unit) { return std::find(order.begin(), order.end(), unit) - order.begin(); };
  for (std::size_t i = 0; i < orders.first.size(); ++i) {
    if (order[i] != orders.first[i]) return false;
  }
  return std::all_of(orders.chains.begin(), orders.chains.end(), [&](const std::vector<UnitBlock> &chain) {
    return std::is_sorted(chain.begin(), chain.end(),
                          [&](const UnitBlock &a, const UnitBlock &b) { return place(a[0]) < place(b[0]); });
  });
}

// No order that keeps the chains is better than the one found.
TEST(AudsleyProperty, ChainsKeepTheirOrder) {
  int tried = 0;
  int found_some = 0;
  int free_only = 0;  // schedulable in an order that the chains exclude
  for (int i = 0; i < static_cast<int>(testing::how_many(300)); ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 77));
    BoundCaseLimits limits;
    limits.max_dags = 5;
    limits.edges = true;
    limits.max_deadline = 1.6;
    limits.min_utilization = 0.4;
    limits.min_workers = limits.max_workers = testing::between(rng, 1, 2);
    limits.policies = {PolicyKind::RateMonotonic};
    const BoundCase bound_case = testing::random_bound_case(rng, limits);
    const analysis::TaskSet task_set = analysis::compile(bound_case.workload, bound_case.platform).value();
    const TestChoice choice = order_free_test(bound_case.workload, bound_case.platform);
    const auto count = static_cast<std::uint32_t>(task_set.units.size());
    if (!choice.test || count < 3 || count > 5) continue;
    SCOPED_TRACE(describe(bound_case));
    Orders orders;
    orders.chains.resize(2);
    for (std::uint32_t unit = 0; unit < count; ++unit) {
      if (unit == 2 && testing::chance(rng, 0.3)) {
        orders.first.push_back(unit);
      } else {
        orders.chains[testing::between(rng, 0, 1)].push_back({unit});
      }
    }
    const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
    const auto found = audsley(bound_case.workload, bound_case.platform, *choice.test, orders, lateness);
    ASSERT_TRUE(found);
    ASSERT_TRUE(is_among(orders, found->order));
    const UnderTest best = under(*choice.test, bound_case, task_set, found->order);
    ASSERT_EQ(best.all_fit, !found->failure);
    ++tried;
    found_some += best.all_fit ? 1 : 0;
    UnitOrder order(count);
    std::iota(order.begin(), order.end(), 0);
    bool any_fits = false;
    do {
      const UnderTest other = under(*choice.test, bound_case, task_set, order);
      any_fits = any_fits || other.all_fit;
      if (!is_among(orders, order)) continue;
      ASSERT_LE(best.worst, other.worst);
      ASSERT_TRUE(best.all_fit || !other.all_fit);
    } while (std::next_permutation(order.begin(), order.end()));
    free_only += any_fits && !best.all_fit ? 1 : 0;
  }
  EXPECT_GT(tried, 50);
  EXPECT_GT(found_some, 10);
  EXPECT_GT(free_only, 0);
}

// A block is as late as its worst unit, and its units stay neighbours.
TEST(Audsley, SaysWhichUnitHasNoPlace) {
  const Workload workload = independent({{2, 10, 4}, {3, 10, 8}, {4, 20, 12}});
  const analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  const TestChoice choice = order_free_test(workload, platform);
  ASSERT_TRUE(choice.test);
  const auto lateness = [](Duration response, Duration due) { return static_cast<double>(response - due); };
  const auto free = audsley(workload, platform, *choice.test, {{}, {{{0}}, {{1}}, {{2}}}}, lateness);
  EXPECT_EQ(free->order, (UnitOrder{0, 1, 2}));
  EXPECT_FALSE(free->failure);
  const auto chained = audsley(workload, platform, *choice.test, {{}, {{{1}, {0}}, {{2}}}}, lateness);
  EXPECT_EQ(chained->order, (UnitOrder{1, 0, 2}));
  ASSERT_TRUE(chained->failure);
  EXPECT_EQ(chained->failure->unit, 0U);
  EXPECT_EQ(chained->failure->response, 5);
  EXPECT_EQ(chained->failure->due, 4);
  EXPECT_EQ(chained->failure->rivals, 1U) << "the chain alone";
  const auto blocks = audsley(workload, platform, *choice.test, {{}, {{{0, 2}}, {{1}}}}, lateness);
  EXPECT_EQ(blocks->order, (UnitOrder{0, 2, 1})) << "9 of 8 for the last is less late than 9 of 4";
  EXPECT_EQ(blocks->failure->unit, 1U);
  const auto first = audsley(workload, platform, *choice.test, {{2, 0}, {{{1}}}}, lateness);
  EXPECT_EQ(first->order, (UnitOrder{2, 0, 1}));
  EXPECT_EQ(first->failure->unit, 1U) << "the least urgent one";
}

TEST(AudsleyProperty, OneWorkerWithJitterAndGroups) {
  BoundCaseLimits limits;
  limits.jitter = limits.groups = limits.queues = true;
  limits.max_deadline = 1.6;
  expect_optimal(limits);
}

TEST(AudsleyProperty, OneWorkerRunToCompletion) {
  BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.jitter = limits.queues = true;
  limits.max_deadline = 1.6;
  expect_optimal(limits);
}

TEST(AudsleyProperty, OneWorkerCooperative) {
  BoundCaseLimits limits;
  limits.preemption = sched::Preemption::Cooperative;
  expect_optimal(limits);
}

TEST(AudsleyProperty, OneWorkerDags) {
  BoundCaseLimits limits;
  limits.edges = limits.groups = true;
  expect_optimal(limits);
}

TEST(AudsleyProperty, SeveralWorkers) {
  BoundCaseLimits limits;
  limits.min_workers = 2;
  limits.max_workers = 3;
  limits.jitter = true;
  expect_optimal(limits);
}

TEST(AudsleyProperty, SeveralWorkersDags) {
  BoundCaseLimits limits;
  limits.min_workers = 2;
  limits.max_workers = 3;
  limits.edges = limits.caps = true;
  limits.min_deadline = 0.8;
  limits.max_utilization = 0.8;
  expect_optimal(limits);
}

}  // namespace
}  // namespace redag::lab
