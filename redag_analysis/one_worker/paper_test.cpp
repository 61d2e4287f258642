// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/paper.hpp"

#include <gtest/gtest.h>

#include "tests/testing/bound_property.hpp"

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

}  // namespace
}  // namespace redag::analysis
