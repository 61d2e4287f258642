// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/offsets.hpp"

#include <gtest/gtest.h>

#include <variant>

#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

// Related periods, and an offset for each timer.
testing::BoundGenerator with_offsets(sched::Preemption preemption, bool edges) {
  testing::BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.edges = limits.rates = edges;
  limits.jitter = limits.caps = limits.levels = limits.overheads = limits.queues = true;
  limits.groups = preemption != sched::Preemption::Cooperative;
  limits.max_deadline = 2.5;
  limits.max_dags = edges ? 3 : 6;
  return [limits](Rng &rng) {
    testing::BoundCase bound_case = random_bound_case(rng, limits);
    for (Dag &dag : bound_case.workload.dags) {
      for (Task &task : dag.tasks) {
        if (limits.edges || task.activation != Activation::Timer) continue;
        task.period = 6 * rng.uniform(1, 6);
        task.wcet = task.bcet = std::min(task.wcet, std::max<Duration>(1, task.period / 3));
        task.offset = rng.uniform(0, task.period);
      }
    }
    return bound_case;
  };
}

const testing::BoundPropertyOptions kKept{.workloads = 250, .keeps_grids = true};

TEST(BoundProperty, OffsetsPreemptive) {
  expect_bound_holds(offsets(), with_offsets(sched::Preemption::Full, false), kKept);
}

TEST(BoundProperty, OffsetsNonpreemptive) {
  expect_bound_holds(offsets(), with_offsets(sched::Preemption::None, false), kKept);
}

TEST(BoundProperty, OffsetsCooperative) {
  expect_bound_holds(offsets(), with_offsets(sched::Preemption::Cooperative, false), kKept);
}

TEST(BoundProperty, OffsetsOfDags) {
  expect_bound_holds(offsets(), with_offsets(sched::Preemption::Full, true), kKept);
}

TEST(BoundProperty, OffsetsOfNonpreemptiveDags) {
  expect_bound_holds(offsets(), with_offsets(sched::Preemption::None, true), kKept);
}

// Jobs of one DAG that never meet, and a DAG that begins at any time.
TEST(Offsets, OtherDagsBeginAtAnyTime) {
  const testing::TestTask a{.name = "a", .period = 20, .wcet = 4};
  const testing::TestTask b{.name = "b", .period = 20, .wcet = 5};
  Workload workload = testing::make_workload({testing::tick_dag("d", {a, b})}, 1, PreemptionMode::Auto);
  workload.ties = Ties::Fixed;
  workload.dags[0].tasks[1].offset = 10;
  const auto responses = [&] {
    const Outcome outcome = offsets().apply(testing::compiled(workload));
    std::vector<Duration> found;
    for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) found.push_back(bound.response.value_or(-1));
    return found;
  };
  EXPECT_EQ(responses(), (std::vector<Duration>{4, 5}));
  workload.dags.push_back(testing::tick_dag("e", {{.name = "c", .period = 10, .wcet = 3}}));
  EXPECT_EQ(responses(), (std::vector<Duration>{7, 8, 3}));
  workload.dags[0].tasks[0].jitter = 8;  // a is seen at 8 and again at 20, and b at 10
  EXPECT_EQ(responses(), (std::vector<Duration>{15, 17, 3}));
}

// A task without a grid that is known keeps the bound that holds for any offset.
TEST(Offsets, WithoutACommonClockThereAreNone) {
  Workload workload = testing::independent({{4, 20}, {5, 20}});
  workload.dags[0].tasks.push_back(workload.dags.back().tasks[0]);
  workload.dags.resize(1);
  workload.dags[0].tasks[1].name = "other";
  workload.dags[0].tasks[0].offset = 10;
  EXPECT_TRUE(std::holds_alternative<Bound>(offsets().apply(testing::compiled(workload))));
  workload.dags[0].tasks[1].phase = Phase::Unknown;
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(offsets().apply(testing::compiled(workload))));
  workload.dags[0].tasks[1].phase = Phase::Common;
  AnalysisPlatform platform = platform_of(workload);
  platform.stall.per_second = 1;
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(offsets().apply(testing::compiled(workload, platform))));
}

}  // namespace
}  // namespace redag::analysis
