// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_groups.hpp"

#include <gtest/gtest.h>

#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;

BoundCaseLimits with_groups(bool edges) {
  BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.max_workers = 4;
  limits.edges = edges;
  limits.groups = true;
  limits.caps = edges;  // bounds that cannot bind
  limits.max_dags = edges ? 4 : 7;
  limits.max_tasks = 6;
  limits.jitter = limits.overheads = true;
  limits.max_deadline = 1.5;
  limits.min_utilization = 0.05;
  limits.max_utilization = 0.4;
  limits.min_period = 10;
  limits.max_period = 150;
  return limits;
}

TEST(BoundProperty, DagGroups) { expect_bound_holds(dag_groups(), cases(with_groups(true)), {.workloads = 2000}); }

TEST(BoundProperty, DagGroupsOfIndependentTasks) {
  expect_bound_holds(dag_groups(), cases(with_groups(false)), {.workloads = 2000});
}

BoundCaseLimits preempted(BoundCaseLimits limits) {
  limits.preemption = sched::Preemption::Full;
  limits.max_utilization = 0.6;
  return limits;
}

TEST(BoundProperty, DagGroupsPreemptive) {
  expect_bound_holds(dag_groups(), cases(preempted(with_groups(true))), {.workloads = 2000});
}

TEST(BoundProperty, DagGroupsPreemptiveOfIndependentTasks) {
  expect_bound_holds(dag_groups(), cases(preempted(with_groups(false))), {.workloads = 2000});
}

// Few tasks crowded onto two workers: a holder that inherits often delays tasks outside its group.
TEST(BoundProperty, DagGroupsPreemptiveCrowded) {
  BoundCaseLimits limits = preempted(with_groups(false));
  limits.min_workers = limits.max_workers = 2;
  limits.max_dags = 5;
  limits.jitter = limits.overheads = false;
  limits.min_utilization = 0.3;
  limits.max_utilization = 0.8;
  limits.min_period = 6;
  limits.max_period = 40;
  expect_bound_holds(dag_groups(), cases(limits), {.workloads = 1000, .runs = 20, .periods = 20});
}

// Deadlines and utilizations at which instances of one DAG overlap.
BoundCaseLimits overlapping(bool edges) {
  BoundCaseLimits limits = preempted(with_groups(edges));
  limits.max_dags = edges ? 3 : 5;
  limits.max_tasks = 4;
  limits.caps = false;
  limits.min_utilization = 0.3;
  limits.max_utilization = 0.6;
  limits.min_period = 15;
  limits.max_period = 60;
  limits.max_deadline = 4;
  return limits;
}

TEST(BoundProperty, DagGroupsOfInstancesThatOverlap) {
  expect_bound_holds(dag_groups(), cases(overlapping(true)), {.workloads = 2000, .runs = 10});
}

TEST(BoundProperty, DagGroupsOfJobsThatOverlap) {
  BoundCaseLimits limits = overlapping(false);
  limits.queues = true;
  expect_bound_holds(dag_groups(), cases(limits), {.workloads = 2000, .runs = 10});
}

TEST(BoundProperty, DagGroupsWithMaxActive) {
  BoundCaseLimits limits = overlapping(true);
  limits.caps = true;
  limits.max_tasks = 6;
  expect_bound_holds(dag_groups(), cases(limits), {.workloads = 2000, .runs = 10});
}

TEST(BoundProperty, DagGroupsAnyOrder) {
  for (const PolicyKind policy : {PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::ChainAware, PolicyKind::Fixed}) {
    BoundCaseLimits limits = overlapping(true);
    limits.policies = {policy};
    limits.levels = policy == PolicyKind::ChainAware || policy == PolicyKind::Fixed;
    limits.caps = true;
    expect_bound_holds(dag_groups(), cases(limits), {.workloads = 1000, .runs = 10});
    limits.preemption = sched::Preemption::None;
    limits.max_utilization = 0.6;
    limits.levels = false;
    expect_bound_holds(dag_groups(), cases(limits), {.workloads = 1000, .runs = 10});
  }
}

TEST(BoundProperty, DagGroupsOfSharedLevels) {
  BoundCaseLimits limits = overlapping(true);
  limits.levels = limits.caps = true;
  expect_bound_holds(dag_groups(), cases(limits), {.workloads = 2000, .runs = 10});
}

TEST(BoundProperty, DagGroupsOnOneWorker) {
  BoundCaseLimits limits = overlapping(true);
  limits.min_workers = limits.max_workers = 1;
  limits.caps = true;
  expect_bound_holds(dag_groups(), cases(limits), {.workloads = 2000, .runs = 10});
}

Workload three_of_a_group() {
  Workload workload = testing::independent({{10, 100}, {10, 200}, {10, 300}}, 2);
  for (Dag &dag : workload.dags) dag.tasks[0].group = "driver";
  return workload;
}

Bound bound_of(const Workload &workload, sched::Preemption preemption) {
  return std::get<Bound>(dag_groups().apply(testing::compiled(workload, preemption)));
}

// More workers do not help a group: the least urgent task waits for both others in full.
TEST(GlobalGroups, AGroupIsOneWorker) {
  for (const sched::Preemption preemption : {sched::Preemption::None, sched::Preemption::Full}) {
    const Bound bound = bound_of(three_of_a_group(), preemption);
    EXPECT_GE(bound.tasks[0].response.value(), 10 + 9);
    EXPECT_GE(bound.tasks[2].response.value(), 30);
  }
}

// A holder that inherits takes a worker from a task that is in no group itself.
TEST(GlobalGroups, AHolderThatInheritsIsInTheWayOfOthers) {
  Workload workload = three_of_a_group();
  workload.dags[2] = testing::tick_dag("between", {{"other", 150, 5}});
  // The task waits for no group. The most urgent task and its holder, of C - 1, take both workers.
  EXPECT_EQ(bound_of(workload, sched::Preemption::Full).tasks[2].response, 5 + (10 + 9) / 2);
  EXPECT_EQ(bound_of(workload, sched::Preemption::Full).tasks[0].response, 10 + 9);
  workload.dags[1].tasks[0].group.clear();
  workload.dags[0].tasks[0].group.clear();
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(dag_groups().apply(testing::compiled(workload))));
}

// The properties above cover the cases that they are meant for.
TEST(GlobalGroups, ResponsesAboveThePeriodAreBounded) {
  std::uint32_t beyond = 0;
  std::uint32_t binding = 0;
  BoundCaseLimits limits = overlapping(true);
  limits.caps = true;
  testing::for_cases(cases(limits), 3000, [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
    const Outcome outcome = dag_groups().apply(task_set);
    const Bound *bound = std::get_if<Bound>(&outcome);
    if (bound == nullptr) return;
    for (std::size_t d = 0; d < bound->dags.size(); ++d) {
      const CompiledDag &dag = task_set.dags[d];
      if (!bound->dags[d].response) continue;
      beyond += *bound->dags[d].response > task_set.tasks[dag.tasks.front()].period ? 1U : 0U;
      binding += dag.max_active > 0 && dag.tasks.size() > dag.max_active ? 1U : 0U;
    }
  });
  EXPECT_GT(beyond, 40U);
  EXPECT_GT(binding, 50U);
}

TEST(GlobalGroups, TermsAddUp) {
  std::uint64_t applied = 0;
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Rng rng(mix(seed));
    const testing::BoundCase bound_case =
        random_bound_case(rng, seed % 4 < 2 ? with_groups(seed % 2 == 0) : preempted(with_groups(seed % 2 == 0)));
    const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
    const Outcome outcome = dag_groups().apply(task_set);
    if (!std::holds_alternative<Bound>(outcome)) continue;
    ++applied;
    for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) {
      Duration sum = 0;
      for (const Term &term : bound.terms) sum += term.amount;
      ASSERT_EQ(sum, bound.response.value_or(0)) << describe(bound_case);
    }
  }
  EXPECT_GT(applied, 250U);
}

}  // namespace
}  // namespace redag::analysis
