// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds for jobs that wait without a worker: no simulated job answers later, and what they are made of.
#include "redag_analysis/core/waiting.hpp"

#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::BoundGenerator;
using testing::compiled;
using testing::expect_bound_holds;

// Waits count as execution, so the processors are drawn half empty.
BoundGenerator with_waits(BoundCaseLimits limits) {
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.5;
  limits.max_dags = 4;
  limits.max_period = 200;
  return [limits](Rng &rng) {
    testing::BoundCase drawn = testing::random_bound_case(rng, limits);
    testing::add_waits(rng, drawn.workload);
    return drawn;
  };
}

TEST(BoundProperty, RtaPreemptiveWithWaits) {
  expect_bound_holds(rta_preemptive(), with_waits({.jitter = true, .queues = true}), {.workloads = 2000});
}

TEST(BoundProperty, DagOneWorkerPreemptiveWithWaits) {
  expect_bound_holds(rta_preemptive(), with_waits({.edges = true, .jitter = true, .caps = true}), {.workloads = 2000});
}

// Periods 100, 200, 300; hi and lo ask the device, which mid does not need.
Workload three(Device::Queue queue = Device::Queue::Priority) {
  Workload workload =
      testing::make_workload({testing::tick_dag("a", {{"hi", 100, 4}}), testing::tick_dag("b", {{"mid", 200, 10}}),
                              testing::tick_dag("c", {{"lo", 300, 6}}), testing::tick_dag("d", {{"least", 400, 6}})},
                             1, PreemptionMode::Auto);
  workload.platform.devices = {Device{"gpu", 1, queue}};
  const DeviceId gpu(std::size_t{0});
  workload.dags[0].tasks[0].waits = {Wait{1, 5, 0, gpu}, Wait{2, 3, 0, {}}};
  workload.dags[2].tasks[0].waits = {Wait{1, 7, 0, gpu}};
  workload.dags[3].tasks[0].waits = {Wait{1, 8, 0, gpu}, Wait{3, 2, 0, gpu}};
  return workload;
}

std::vector<Duration> totals(const Workload &workload) {
  std::vector<Duration> times;
  for (const WaitingTime &time : waiting_times(workload)) times.push_back(time.total());
  return times;
}

TEST(WaitingTimes, AreOwnWaitsAndOneLessUrgentServiceForEachRequest) {
  EXPECT_EQ(totals(three()), (std::vector<Duration>{5 + 8 + 3, 0, 7 + 8, 8 + 2}));
  EXPECT_EQ(totals(three(Device::Queue::Fifo)), (std::vector<Duration>{5 + 7 + 8 + 3, 0, 7 + 8, 8 + 2}));
  EXPECT_EQ(waiting_times(three())[3].devices, (std::vector<DeviceUse>{{2, 10, 8, 0}}));
  EXPECT_EQ(waiting_times(three())[0].elsewhere, 3);
  EXPECT_TRUE(waiting_times(testing::independent({{1, 10}})).empty());
}

TEST(WaitingTimes, CountAsExecutionInTheBound) {
  const TaskSet task_set = compiled(three());
  EXPECT_TRUE(task_set.has_waits);
  AnalyzeOptions options;
  options.itemise = true;
  const Report report = analyze(task_set, options);
  const Bound bound = std::get<Bound>(rta_preemptive().apply(task_set));
  EXPECT_EQ(bound.tasks[0].response, 4 + 16);
  EXPECT_EQ(bound.tasks[0].sum(Term::Kind::Own), 4);
  EXPECT_EQ(bound.tasks[0].sum(Term::Kind::Suspended), 8);
  EXPECT_EQ(bound.tasks[0].sum(Term::Kind::Blocking), 8);
  EXPECT_EQ(bound.tasks[1].response, 10 + 20);
  EXPECT_EQ(bound.tasks[2].response, 6 + 15 + 20 + 10);
  for (const MethodReport &method : report.methods) EXPECT_TRUE(!method.trusted || method.method->knows_waits);
}

void expect_uncovered(const Workload &workload, const AnalysisPlatform &platform, const std::string &why) {
  const TaskSet task_set = compiled(workload, platform);
  EXPECT_TRUE(task_set.is_beyond_all());
  EXPECT_EQ(task_set.not_analysable, why);
  for (const MethodReport &method : analyze(task_set).methods) EXPECT_TRUE(!method.trusted || method.method->knows_all);
}

TEST(WaitingTimes, AreNotCoveredWhereNoProofIsKnown) {
  const AnalysisPlatform one = platform_of(three());
  AnalysisPlatform other = one;
  other.levels = 2;
  expect_uncovered(three(), other,
                   "callbacks that wait (segments) have bounds only if each priority has a level of its own");
  other.levels = 8;
  EXPECT_TRUE(compiled(three(), other).has_waits);
  other.max_started = 4;
  EXPECT_TRUE(compiled(three(), other).has_waits);
  Workload workload = testing::make_workload({testing::tick_dag("a", {{"first", 100, 4, {}}, {"then", 100, 2, {0}}})},
                                             1, PreemptionMode::Auto);
  workload.dags[0].tasks[0].waits = {Wait{1, 5, 0, {}}};
  other = platform_of(workload);
  other.max_started = 1;
  expect_uncovered(workload, other, "callbacks that wait (segments) have bounds only with as many threads as tasks");
  workload = three();
  workload.dags[0].tasks[0].region = 1;
  other = one;
  other.preemption = sched::Preemption::Cooperative;
  expect_uncovered(workload, other,
                   "callbacks that wait (segments) have bounds only without cooperative preemption points");
  workload = three();
  workload.dags[0].tasks[0].group = workload.dags[1].tasks[0].group = "g";
  expect_uncovered(workload, one,
                   "callbacks that wait (segments) have bounds only without groups, which a job holds while it waits");
}

}  // namespace
}  // namespace redag::analysis
