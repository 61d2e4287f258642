// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/paper.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <tuple>
#include <utility>

#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;

testing::BoundGenerator cases(sched::Preemption preemption, bool different_periods) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.min_deadline = 1.0;
  limits.equal_periods = !different_periods;
  limits.min_utilization = 0.4;
  limits.max_period = 120;
  limits.max_dags = 4;
  return [limits](Rng &rng) { return testing::random_bound_case(rng, limits); };
}

const testing::BoundPropertyOptions kFew{.workloads = 250};

// Where the hypotheses hold, the paper's equations are bounds.
TEST(BoundProperty, PaperWhereSound) {
  for (const Method &method : {paper_rm_bound(), paper_interference(), paper_rta(), paper_rta_blocking()}) {
    expect_bound_holds(method, cases(sched::Preemption::Full, true), kFew);
  }
  expect_bound_holds(paper_rta_blocking(), cases(sched::Preemption::None, true), kFew);
}

// Where the hypotheses do not hold, simulations exceed the numbers: the label `unsound` is justified.
TEST(BoundProperty, PaperWhereUnsound) {
  const testing::BoundPropertyOptions all{.workloads = 250, .include_unsound = true};
  EXPECT_GT(check_bound(paper_interference(), cases(sched::Preemption::Full, true), all).violations, 0U);
  EXPECT_GT(check_bound(paper_rta(), cases(sched::Preemption::Full, false), all).violations, 0U);
  EXPECT_GT(check_bound(paper_rta(), cases(sched::Preemption::None, true), all).violations, 0U);
  EXPECT_GT(check_bound(paper_rm_bound(), cases(sched::Preemption::None, true), all).violations, 0U);
}

// Equals of one period and of several, DAGs, blocking and jitter: the limit counts only where it is sound.
TEST(BoundProperty, PaperRmBound) {
  BoundCaseLimits limits;
  limits.policies = {PolicyKind::Fixed, PolicyKind::RateMonotonic};
  limits.min_deadline = 0.9;
  limits.max_deadline = 1.2;
  limits.max_dags = 3;
  limits.max_utilization = 0.8;
  limits.jitter = limits.groups = limits.levels = limits.caps = limits.overheads = true;
  for (const bool edges : {false, true}) {
    limits.edges = edges;
    expect_bound_holds(paper_rm_bound(), testing::cases(limits), kFew);
  }
}

std::optional<bool> accepted(const Workload &workload) {
  const Bound bound = std::get<Bound>(paper_rm_bound().apply(testing::compiled(workload)));
  return bound.unsound.empty() ? bound.accepts : std::nullopt;
}

// The limit of two tasks is 2 sqrt(2) - 2. The test takes the nearest fractions on both sides, from the continued
// fraction of sqrt(2), as long as they differ from it by more than rounding.
TEST(PaperRmBound, DecidesBesideItsLimit) {
  EXPECT_EQ(accepted(testing::independent({{7, 7}})), true);
  std::int64_t p = 1;
  std::int64_t q = 1;
  for (; q < 10'000'000; std::tie(p, q) = std::pair(p + 2 * q, p + q)) {
    if (q < 3) continue;
    const bool is_below = p * p < 2 * q * q;
    EXPECT_EQ(accepted(testing::independent({{p - q, q}, {p - q, q}})), is_below) << p << " / " << q;
  }
}

TEST(PaperRmBound, NeedsTheOrderByRate) {
  Workload workload = testing::independent({{1, 50}, {1, 5}}, 1, PolicyKind::Fixed);
  EXPECT_FALSE(accepted(workload)) << "the first is the more urgent one";
  workload.dags[0].tasks[0].priority = workload.dags[1].tasks[0].priority;
  EXPECT_FALSE(accepted(workload)) << "they take turns";
  workload.policy = PolicyKind::RateMonotonic;
  EXPECT_TRUE(accepted(workload));
  workload.dags[0].tasks[0].jitter = 1;
  EXPECT_FALSE(accepted(workload));
  workload.dags[0].tasks[0].jitter = 0;
  workload.dags[0].tasks[0].deadline -= 1;
  EXPECT_FALSE(accepted(workload));
}

}  // namespace
}  // namespace redag::analysis
