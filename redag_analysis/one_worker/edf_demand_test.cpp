// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/edf_demand.hpp"

#include <gtest/gtest.h>

#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;

testing::BoundGenerator edf_cases(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.policies = {PolicyKind::Edf};
  limits.jitter = limits.overheads = limits.queues = true;
  limits.groups = preemption == sched::Preemption::None;
  limits.min_utilization = 0.4;
  return [limits](Rng &rng) { return testing::random_bound_case(rng, limits); };
}

const testing::BoundPropertyOptions kFew{.workloads = 250};

TEST(BoundProperty, EdfDemand) { expect_bound_holds(edf_demand(), edf_cases(sched::Preemption::Full), kFew); }

TEST(BoundProperty, EdfDemandNonpreemptive) {
  expect_bound_holds(edf_demand_nonpreemptive(), edf_cases(sched::Preemption::None), kFew);
}

TEST(BoundProperty, EdfDemandCooperative) {
  expect_bound_holds(edf_demand_nonpreemptive(), edf_cases(sched::Preemption::Cooperative), kFew);
}

}  // namespace
}  // namespace redag::analysis
