// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/jobs_in_progress.hpp"

#include <gtest/gtest.h>
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using redag::testing::TestTask;

std::size_t most(const std::vector<TestTask> &tasks) {
  const auto task_set = compile(make_workload({make_dag("d", tasks)}, 1), AnalysisPlatform{});
  return most_jobs_in_progress(task_set.value(), DagId(0));
}

TEST(JobsInProgress, TasksThatFollowEachOtherAreNeverInProgressTogether) {
  EXPECT_EQ(most({{.name = "a", .period = 10}}), 1U);
  EXPECT_EQ(most({{.name = "a", .period = 10}, {.name = "b", .after = {0}}, {.name = "c", .after = {1}}}), 1U);
  EXPECT_EQ(most({{.name = "a", .period = 10}, {.name = "b", .period = 10}}), 2U) << "no edge";
}

// The graph a -> {b, c} -> d and b -> e. The largest antichains are {b, c} and {c, e}; d follows b and c but not e.
TEST(JobsInProgress, TheWidthOfAGraph) {
  const std::vector<TestTask> graph = {{.name = "a", .period = 10},
                                       {.name = "b", .after = {0}},
                                       {.name = "c", .after = {0}},
                                       {.name = "d", .after = {1, 2}},
                                       {.name = "e", .after = {1}}};
  EXPECT_EQ(most(graph), 2U);
  std::vector<TestTask> wider = graph;
  wider.push_back({.name = "f", .after = {0}});
  EXPECT_EQ(most(wider), 3U);
}

// A fused task has the grid of its slowest predecessor, which it follows. Another offset is another grid.
TEST(JobsInProgress, OneChainAGrid) {
  EXPECT_EQ(most({{.name = "fast", .period = 5}, {.name = "slow", .period = 20}, {.name = "f", .after = {0, 1}}}), 2U);
  EXPECT_EQ(most({{.name = "a", .period = 20}, {.name = "b", .period = 20, .after = {0}, .offset = 1}}), 2U);
}

}  // namespace
}  // namespace redag::analysis
