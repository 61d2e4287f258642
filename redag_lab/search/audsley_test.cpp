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
    const auto found = audsley(bound_case.workload, bound_case.platform, *choice.test, lateness);
    ASSERT_TRUE(found);
    const UnderTest best = under(*choice.test, bound_case, task_set, *found);
    ++tried;
    UnitOrder order(task_set.units.size());
    std::iota(order.begin(), order.end(), 0);
    do {
      const UnderTest other = under(*choice.test, bound_case, task_set, order);
      ASSERT_LE(best.worst, other.worst);
      ASSERT_TRUE(best.all_fit || !other.all_fit);
    } while (std::next_permutation(order.begin(), order.end()));
    if (!best.all_fit) continue;
    ++found_some;
    const analysis::TaskSet ordered =
        analysis::compile(with_order(bound_case.workload, task_set, *found), bound_case.platform).value();
    ASSERT_EQ(analysis::analyze(ordered).verdict, analysis::Verdict::Schedulable);
  }
  EXPECT_GT(tried, cases / 4);
  EXPECT_GT(found_some, cases / 20);
  EXPECT_LT(found_some, tried);
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
