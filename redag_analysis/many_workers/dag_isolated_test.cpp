// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/dag_isolated.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;

BoundCaseLimits graphs(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.max_workers = 6;
  limits.edges = true;
  limits.max_dags = 1;
  limits.max_tasks = 12;
  limits.jitter = limits.overheads = limits.caps = true;
  limits.policies = {PolicyKind::RateMonotonic, PolicyKind::Fixed, PolicyKind::Edf, PolicyKind::Fifo};
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.6;
  limits.min_period = 20;
  limits.max_period = 200;
  return limits;
}

TEST(BoundProperty, IsolatedAlone) {
  expect_bound_holds(isolated(), cases(graphs(sched::Preemption::Full)), {.workloads = 1000});
  expect_bound_holds(isolated(), cases(graphs(sched::Preemption::None)), {.workloads = 1000});
}

// Small DAGs with bounds of one or two. For what the generator otherwise draws, few workers would hardly ever suffice.
testing::BoundGenerator isolated_cases(sched::Preemption preemption) {
  BoundCaseLimits limits = graphs(preemption);
  limits.max_dags = 4;
  limits.max_tasks = 6;
  limits.min_workers = 3;
  limits.max_utilization = 0.7;
  return [limits](Rng &rng) {
    testing::BoundCase result = random_bound_case(rng, limits);
    for (Dag &dag : result.workload.dags) {
      if (rng.uniform(0, 3) > 0) dag.max_active = static_cast<std::uint32_t>(rng.uniform(1, 2));
    }
    return result;
  };
}

TEST(BoundProperty, Isolated) {
  expect_bound_holds(isolated(), isolated_cases(sched::Preemption::Full), {.workloads = 1000});
  expect_bound_holds(isolated(), isolated_cases(sched::Preemption::None), {.workloads = 1000});
  expect_bound_holds(isolated(), isolated_cases(sched::Preemption::Cooperative), {.workloads = 1000});
}

// A source, three parallel tasks, and a sink.
Dag fork_join(std::string name, Duration period = 100) {
  return testing::tick_dag(
      std::move(name),
      {{"source", period, 2}, {"a", 0, 10, {0}}, {"b", 0, 9, {0}}, {"c", 0, 8, {0}}, {"sink", 0, 3, {1, 2, 3}}});
}

TaskSet compiled(std::uint32_t workers, std::vector<Dag> dags, sched::Preemption preemption) {
  return testing::compiled(testing::make_workload(std::move(dags), workers), preemption);
}

std::optional<Duration> dag_response(const Method &method, const TaskSet &task_set, std::size_t dag) {
  const Outcome outcome = method.apply(task_set);
  return std::get<Bound>(outcome).dags[dag].response;
}

TEST(DagIsolated, LongPathsCountWhatRunsBesideThem) {
  // len 15, vol 32; paths of 15, 9 and 8. On three workers nothing waits; on two, j = 1 leaves 8 for one worker.
  const TaskSet three = compiled(3, {fork_join("d")}, sched::Preemption::Full);
  EXPECT_EQ(dag_response(isolated(), three, 0), 15);
  const TaskSet two = compiled(2, {fork_join("d")}, sched::Preemption::Full);
  EXPECT_EQ(dag_response(isolated(), two, 0), 15 + std::min(17 / 2, 8));
}

TEST(DagIsolated, BoundsThatSumUpToTheWorkersShareNothing) {
  Dag first = fork_join("first");
  Dag second = fork_join("second", 110);
  first.max_active = 2;
  second.max_active = 1;
  const TaskSet enough = compiled(3, {first, second}, sched::Preemption::None);
  EXPECT_EQ(dag_response(isolated(), enough, 0), 15 + 8);
  EXPECT_EQ(dag_response(isolated(), enough, 1), 32);

  // Two workers suffice for the first DAG only if it can take them from the second.
  const TaskSet preemptive = compiled(2, {first, second}, sched::Preemption::Full);
  EXPECT_EQ(dag_response(isolated(), preemptive, 0), 15 + 8);
  EXPECT_FALSE(dag_response(isolated(), preemptive, 1));
  const TaskSet nonpreemptive = compiled(2, {first, second}, sched::Preemption::None);
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(isolated().apply(nonpreemptive)));
  // They do not suffice if the second takes turns with it.
  const TaskSet equals = compiled(2, {first, fork_join("second")}, sched::Preemption::Full);
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(isolated().apply(equals)));
}

TEST(DagIsolated, TheMostUrgentHasAllWorkersWhereItPreempts) {
  const TaskSet task_set = compiled(2, {fork_join("first"), fork_join("second", 110)}, sched::Preemption::Full);
  EXPECT_EQ(dag_response(isolated(), task_set, 0), 15 + 8);
  EXPECT_FALSE(dag_response(isolated(), task_set, 1));
}

// It once compared each DAG with all tasks of all others: this would take hours.
TEST(DagIsolated, TwentyThousandDags) {
  std::vector<Dag> dags;
  for (int d = 0; d < 20'000; ++d) dags.push_back(testing::tick_dag("d" + std::to_string(d), {{"t", 1000 + d, 1}}));
  const TaskSet task_set = compiled(4, std::move(dags), sched::Preemption::Full);
  EXPECT_EQ(dag_response(isolated(), task_set, 3), 1);
  EXPECT_FALSE(dag_response(isolated(), task_set, 4));
}

}  // namespace
}  // namespace redag::analysis
