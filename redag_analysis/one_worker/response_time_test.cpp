// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/response_time.hpp"

#include <variant>

#include <gtest/gtest.h>

#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;

BoundCaseLimits everything(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.jitter = limits.groups = limits.caps = limits.levels = limits.overheads = limits.queues = true;
  limits.max_deadline = 2.5;
  return limits;
}

const testing::BoundPropertyOptions kFew{.workloads = 250, .from_source = true};

TEST(BoundProperty, RtaPreemptiveClassic) { expect_bound_holds(rta_preemptive(), cases({}), kFew); }

TEST(BoundProperty, RtaPreemptiveWithEverything) {
  expect_bound_holds(rta_preemptive(), cases(everything(sched::Preemption::Full)), kFew);
}

TEST(BoundProperty, RtaNonpreemptive) {
  expect_bound_holds(rta_nonpreemptive(), cases(everything(sched::Preemption::None)), kFew);
}

TEST(BoundProperty, RtaDeferred) {
  BoundCaseLimits limits = everything(sched::Preemption::Cooperative);
  limits.groups = false;
  expect_bound_holds(rta_deferred(), cases(limits), kFew);
}

TEST(BoundProperty, DagOneWorkerPreemptive) {
  BoundCaseLimits limits = everything(sched::Preemption::Full);
  limits.edges = true;
  limits.max_dags = 4;
  expect_bound_holds(rta_preemptive(), cases(limits), kFew);
}

TEST(BoundProperty, DagOneWorkerNonpreemptive) {
  BoundCaseLimits limits = everything(sched::Preemption::None);
  limits.edges = true;
  limits.max_dags = 4;
  expect_bound_holds(rta_nonpreemptive(), cases(limits), kFew);
}

TEST(BoundProperty, DagOneWorkerCooperative) {
  BoundCaseLimits limits = everything(sched::Preemption::Cooperative);
  limits.edges = true;
  limits.groups = false;
  limits.max_dags = 4;
  expect_bound_holds(rta_deferred(), cases(limits), kFew);
}

// Any of several equals can go first: the one that was released an instant before.
TEST(ResponseTime, EqualsInterfereBothWays) {
  Workload workload = testing::independent({{3, 10}, {4, 10}});
  for (const sched::Preemption mode : {sched::Preemption::Full, sched::Preemption::None}) {
    for (const Ties ties : {Ties::Share, Ties::Fixed}) {
      workload.ties = ties;
      const Outcome outcome = (mode == sched::Preemption::Full ? rta_preemptive() : rta_nonpreemptive())
                                  .apply(testing::compiled(workload, mode));
      const Bound &bound = std::get<Bound>(outcome);
      // In the fixed order the first waits for the second only if that cannot be preempted, and not for all of it.
      const Duration first = ties == Ties::Share ? 7 : mode == sched::Preemption::Full ? 3 : 6;
      EXPECT_EQ(bound.tasks[0].response, first);
      EXPECT_EQ(bound.tasks[1].response, 7);
    }
  }
}

}  // namespace
}  // namespace redag::analysis
