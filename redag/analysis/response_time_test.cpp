#include "redag/analysis/response_time.hpp"

#include <gtest/gtest.h>

#include "redag/testing/bound_property.hpp"

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

const testing::BoundPropertyOptions kFew{.workloads = 250};

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
  expect_bound_holds(dag_one_worker_preemptive(), cases(limits), kFew);
}

TEST(BoundProperty, DagOneWorkerNonpreemptive) {
  BoundCaseLimits limits = everything(sched::Preemption::None);
  limits.edges = true;
  limits.max_dags = 4;
  expect_bound_holds(dag_one_worker_deferred(), cases(limits), kFew);
}

TEST(BoundProperty, DagOneWorkerCooperative) {
  BoundCaseLimits limits = everything(sched::Preemption::Cooperative);
  limits.edges = true;
  limits.groups = false;
  limits.max_dags = 4;
  expect_bound_holds(dag_one_worker_deferred(), cases(limits), kFew);
}

}  // namespace
}  // namespace redag::analysis
