// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/placement.hpp"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "redag/base/rng.hpp"
#include "redag/model/validate.hpp"
#include "redag_lab/search/analysed.hpp"
#include "redag_testing/builders.hpp"
#include "redag_testing/random_workloads.hpp"

namespace redag::lab {
namespace {

using testing::make_dag;

// Two clusters of one worker each.
Workload two_workers(std::vector<Dag> dags) {
  Workload workload = testing::make_workload(std::move(dags), 2, PreemptionMode::Os);
  workload.platform.clusters = {Cluster{"left", 1, {}}, Cluster{"right", 1, {}}};
  return workload;
}

std::vector<std::string> clusters_of(const Workload &workload) {
  std::vector<std::string> names;
  for (const Dag &dag : workload.dags) names.push_back(dag.cluster);
  return names;
}

Placement placed(const Workload &workload) {
  const Result<Placement> placement = place(workload, analysis::platform_of(workload));
  if (!placement) ADD_FAILURE() << to_string(placement.error());
  return placement.value_or(Placement{});
}

TEST(Placement, TakesTheFirstClusterThatFitsLargestFirst) {
  const Workload workload = two_workers(
      {make_dag("small", {{"t", 10, 3}}), make_dag("large", {{"t", 10, 7}}), make_dag("middle", {{"t", 10, 6}})});
  const Placement placement = placed(workload);
  EXPECT_TRUE(placement.is_schedulable());
  EXPECT_EQ(clusters_of(placement.workload), (std::vector<std::string>{"left", "left", "right"}));
  EXPECT_EQ(placement.placed, (std::vector{DagId(1), DagId(2), DagId(0)}));
  EXPECT_EQ(to_string(validate(placement.workload)), "");
}

TEST(Placement, NamesTheDagsThatFitNowhere) {
  const Workload workload =
      two_workers({make_dag("a", {{"t", 10, 6}}), make_dag("b", {{"t", 10, 6}}), make_dag("c", {{"t", 10, 5}})});
  const Placement placement = placed(workload);
  EXPECT_FALSE(placement.is_schedulable());
  EXPECT_EQ(placement.left_over, (std::vector{DagId(2)}));
  EXPECT_EQ(placement.workload.dags[2].cluster, "");
}

TEST(Placement, FitsByTheBoundsAndNotByUtilization) {
  // Together they need 70 % of a worker, but b's deadline leaves no time for a.
  Workload workload = two_workers({make_dag("a", {{"t", 10, 4}}), make_dag("b", {{"t", 20, 6, {}, "", 0, 7}})});
  EXPECT_EQ(clusters_of(placed(workload).workload), (std::vector<std::string>{"left", "right"}));
  workload.dags[1].tasks[0].deadline = 10 * kMillisecond;
  EXPECT_EQ(clusters_of(placed(workload).workload), (std::vector<std::string>{"left", "left"}));
}

TEST(Placement, KeepsDagsOfAGroupTogether) {
  // d joins both groups: all but b are one bundle.
  Workload workload = two_workers({make_dag("a", {{"t", 100, 10, {}, "bus"}}), make_dag("b", {{"t", 100, 90}}),
                                   make_dag("c", {{"t", 100, 10, {}, "arm"}}),
                                   make_dag("d", {{"t", 100, 1, {}, "arm"}, {"u", 100, 1, {}, "bus"}})});
  EXPECT_EQ(clusters_of(placed(workload).workload), (std::vector<std::string>{"right", "left", "right", "right"}));
  workload.dags[1].tasks[0].wcet = workload.dags[1].tasks[0].bcet = kMillisecond;
  workload.dags[0].cluster = "right";
  const Placement placement = placed(workload);
  EXPECT_EQ(clusters_of(placement.workload), (std::vector<std::string>{"right", "left", "right", "right"}));
  EXPECT_EQ(placement.placed, (std::vector{DagId(1)}));
}

TEST(Placement, LeavesDagsWhereTheFileHasThem) {
  Workload workload =
      two_workers({make_dag("a", {{"t", 10, 6}}), make_dag("b", {{"t", 10, 6}}), make_dag("c", {{"t", 10, 1}})});
  workload.dags[0].cluster = workload.dags[1].cluster = "left";
  const Placement placement = placed(workload);
  EXPECT_EQ(clusters_of(placement.workload), (std::vector<std::string>{"left", "left", "right"}));
  EXPECT_EQ(placement.holds, (std::vector{false, true}));
  EXPECT_FALSE(placement.is_schedulable());
}

TEST(Placement, EndsWhenItIsTold) {
  const Workload workload = two_workers({make_dag("a", {{"t", 10, 6}}), make_dag("b", {{"t", 10, 6}})});
  int asked = 0;
  const Placement placement = place(workload, analysis::platform_of(workload), [&] { return ++asked > 1; }).value();
  EXPECT_TRUE(placement.stopped);
  EXPECT_FALSE(placement.is_schedulable());
  EXPECT_EQ(placement.left_over, (std::vector{DagId(1)}));
}

TEST(Placement, IsConfirmedByTheAnalysis) {
  std::size_t schedulable = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    Rng rng(seed);
    Workload workload = testing::contended(rng, false);
    testing::divide(rng, workload);
    for (Dag &dag : workload.dags) {
      if (testing::chance(rng, 0.8)) dag.cluster.clear();
    }
    if (has_errors(validate(workload, {.cluster_optional = true}))) continue;
    const analysis::AnalysisPlatform platform = analysis::platform_of(workload);
    const Placement placement = place(workload, platform).value();
    if (!placement.left_over.empty()) continue;
    ASSERT_FALSE(has_errors(validate(placement.workload))) << "seed " << seed;
    ASSERT_EQ(placement.is_schedulable(), is_schedulable(analyse_parts(placement.workload, platform).value()))
        << "seed " << seed;
    if (placement.is_schedulable()) ++schedulable;
  }
  EXPECT_GT(schedulable, 20U);
}

}  // namespace
}  // namespace redag::lab
