#include "redag/analysis/utilization.hpp"

#include <gtest/gtest.h>

#include "redag/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;

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

TEST(BoundProperty, LiuLayland) {
  expect_bound_holds(liu_layland(), cases(rate_monotonic(sched::Preemption::Full)), kFew);
}

TEST(BoundProperty, LiuLaylandOnDags) {
  BoundCaseLimits limits = rate_monotonic(sched::Preemption::Full);
  limits.edges = limits.caps = true;
  expect_bound_holds(liu_layland(), cases(limits), kFew);
}

TEST(BoundProperty, Hyperbolic) {
  expect_bound_holds(hyperbolic(), cases(rate_monotonic(sched::Preemption::Full)), kFew);
}

TEST(BoundProperty, HarmonicChains) {
  BoundCaseLimits limits = rate_monotonic(sched::Preemption::Full);
  limits.max_period = 16;
  limits.max_dags = 4;
  expect_bound_holds(harmonic_chains(), cases(limits), kFew);
}

TEST(BoundProperty, BlockingPreemptive) {
  expect_bound_holds(liu_layland_blocking(), cases(with_blocking(sched::Preemption::Full)), kFew);
  expect_bound_holds(hyperbolic_blocking(), cases(with_blocking(sched::Preemption::Full)), kFew);
}

TEST(BoundProperty, BlockingNonpreemptive) {
  expect_bound_holds(liu_layland_blocking(), cases(with_blocking(sched::Preemption::None)), kFew);
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
  expect_bound_holds(global_rm_light(), cases(limits), kFew);
  expect_bound_holds(global_rm_utilization(), cases(limits), kFew);
}

}  // namespace
}  // namespace redag::analysis
