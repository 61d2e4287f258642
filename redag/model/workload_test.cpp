// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/workload.hpp"

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag {
namespace {

Task timer(Duration wcet, Duration period) { return testing::tick_task({"t", period, wcet}); }

Task data(Duration wcet, std::vector<std::uint32_t> predecessors) {
  return testing::tick_task({"t", 0, wcet, std::move(predecessors)});
}

TEST(TopologicalRanks, FollowEdgesAndBreakTiesByPosition) {
  Dag dag;
  dag.tasks = {data(1, {3}), timer(1, 10), timer(1, 10), timer(1, 10), data(1, {0, 1})};
  EXPECT_EQ(topological_ranks(dag), (std::vector<std::uint32_t>{3, 0, 1, 2, 4}));
}

TEST(TopologicalRanksDeathTest, NeedsAnAcyclicGraph) {
  Dag dag;
  dag.tasks = {data(1, {1}), data(1, {0})};
  EXPECT_DEATH(static_cast<void>(topological_ranks(dag)), "acyclic");
}

TEST(InheritPeriods, TakesTheLargestOfThePredecessors) {
  Dag dag;
  dag.tasks = {data(1, {1}), data(1, {2, 3}), timer(1, 10), timer(1, 40), timer(1, 80)};
  dag.tasks[0].deadline = 25;
  inherit_periods(dag);
  EXPECT_EQ(dag.tasks[1].period, 40);
  EXPECT_EQ(dag.tasks[1].deadline, 40);
  EXPECT_EQ(dag.tasks[0].period, 40);    // through another data task
  EXPECT_EQ(dag.tasks[0].deadline, 25);  // a given deadline is kept
  EXPECT_EQ(dag.tasks[4].deadline, 80);
}

TEST(InheritPeriods, LeavesTimerTasksWithPredecessorsAlone) {
  Dag dag;
  dag.tasks = {timer(1, 10), timer(1, 20)};
  dag.tasks[1].predecessors = {0};
  inherit_periods(dag);
  EXPECT_EQ(dag.tasks[1].period, 20);
}

TEST(Workload, CountsAndAdds) {
  Workload workload;
  workload.dags.resize(2);
  workload.dags[0].tasks = {timer(1, 10), timer(2, 10)};
  workload.dags[1].tasks = {timer(5, 10)};
  EXPECT_EQ(workload.task_count(), 3U);
  EXPECT_DOUBLE_EQ(workload.utilization(), 0.8);
  const std::vector<TaskRef> refs = flatten(workload);
  ASSERT_EQ(refs.size(), 3U);
  EXPECT_EQ(refs[2].dag, DagId(1));
  EXPECT_EQ(refs[2].index, 0U);
  EXPECT_EQ(refs[2].task, &workload.dags[1].tasks[0]);
}

}  // namespace
}  // namespace redag
