// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/task_set.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/many_workers/dag_isolated.hpp"
#include "redag_analysis/one_worker/edf_demand.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using redag::testing::compiled;
using redag::testing::make_dag;
using redag::testing::make_workload;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Two DAGs: a -> b, a -> c at 20 ms; x alone at 5 ms.
Workload two_dags() {
  return make_workload({make_dag("graph", {{.name = "a", .period = 20, .wcet = 2},
                                           {.name = "b", .wcet = 3, .after = {0}},
                                           {.name = "c", .wcet = 1, .after = {0}}}),
                        make_dag("single", {{.name = "x", .period = 5}})},
                       1);
}

AnalysisPlatform mode(sched::Preemption preemption, std::uint32_t workers = 1) {
  AnalysisPlatform platform;
  platform.preemption = preemption;
  platform.workers = workers;
  return platform;
}

std::string refusal(const Method &method, const Workload &workload, const AnalysisPlatform &platform) {
  const Outcome outcome = method.apply(compiled(workload, platform));
  const auto *reason = std::get_if<NotApplicable>(&outcome);
  return reason == nullptr ? "" : reason->reason;
}

TEST(TaskSet, AGraphOfOneRateIsOneUnit) {
  const TaskSet task_set = compiled(two_dags(), mode(sched::Preemption::Full));
  ASSERT_EQ(task_set.units.size(), 2U);
  EXPECT_THAT(task_set.units[0].tasks, ElementsAre(0, 1, 2));
  EXPECT_EQ(task_set.units[0].volume, 6 * kMillisecond);
  EXPECT_EQ(task_set.units[0].length, 5 * kMillisecond);
  EXPECT_EQ(task_set.units[0].limit, 20 * kMillisecond);
  EXPECT_TRUE(task_set.units[0].has_edges);
  EXPECT_THAT(task_set.tasks[0].successors, ElementsAre(1, 2));
  EXPECT_THAT(task_set.by_rank, ElementsAre(3, 0, 1, 2));
  EXPECT_EQ(task_set.tasks[1].name, "graph.b");
  EXPECT_TRUE(task_set.not_analysable.empty());
}

TEST(TaskSet, RatesThatNoEdgeJoinsAreUnitsOfTheirOwn) {
  const Workload workload = make_workload(
      {make_dag("mixed", {{.name = "a", .period = 20}, {.name = "b", .after = {0}}, {.name = "x", .period = 5}})}, 1);
  const TaskSet task_set = compiled(workload, mode(sched::Preemption::Full));
  ASSERT_EQ(task_set.units.size(), 2U);
  EXPECT_THAT(task_set.units[0].tasks, ElementsAre(0, 1));
  EXPECT_THAT(task_set.units[1].tasks, ElementsAre(2));
  EXPECT_THAT(task_set.dags[0].units, ElementsAre(0, 1));
}

// The tasks that follow the one waiting task belong to its unit, which waits for data of others.
TEST(TaskSet, UnitsAreCutAtRateEdges) {
  const Workload workload = make_workload({make_dag("d", {{.name = "fast", .period = 5},
                                                          {.name = "slow", .period = 20, .offset = 3},
                                                          {.name = "fuse", .after = {0, 1}},
                                                          {.name = "track", .after = {2}},
                                                          {.name = "late", .period = 20, .after = {1}}})},
                                          1);
  const TaskSet task_set = compiled(workload, mode(sched::Preemption::Full));
  ASSERT_EQ(task_set.units.size(), 4U);
  EXPECT_THAT(task_set.units[0].tasks, ElementsAre(0));
  EXPECT_THAT(task_set.units[1].tasks, ElementsAre(1));
  EXPECT_THAT(task_set.units[2].tasks, ElementsAre(2, 3));
  EXPECT_THAT(task_set.units[2].awaits, ElementsAre(0, 1));
  EXPECT_EQ(task_set.units[2].offset, 3 * kMillisecond) << "that of its slowest predecessor";
  EXPECT_EQ(task_set.tasks[3].offset, 3 * kMillisecond);
  EXPECT_THAT(task_set.units[3].awaits, ElementsAre(1)) << "a timer of another offset";
  EXPECT_EQ(task_set.units[3].offset, 0);
  EXPECT_TRUE(task_set.has_rate_edges());
  EXPECT_FALSE(compiled(two_dags(), mode(sched::Preemption::Full)).has_rate_edges());
}

// `join` brings a second waiting task into the part; therefore the part is not released as a whole.
TEST(TaskSet, SeveralTasksThatWaitAreUnitsOfTheirOwn) {
  const Workload workload = make_workload({make_dag("d", {{.name = "fast", .period = 5},
                                                          {.name = "slow", .period = 20},
                                                          {.name = "b", .after = {0, 1}},
                                                          {.name = "c", .after = {0, 1}},
                                                          {.name = "join", .after = {2, 3}}})},
                                          1);
  const TaskSet task_set = compiled(workload, mode(sched::Preemption::Full));
  ASSERT_EQ(task_set.units.size(), 5U);
  EXPECT_THAT(task_set.units[4].awaits, ElementsAre(2, 3));
}

TEST(TaskSet, ExecutionTimesThatAddUpToDecadesAreNotAnalysed) {
  Workload workload = two_dags();
  Task &task = workload.dags[0].tasks[0];
  task.wcet = kMaxDuration / 8 - 10 * kMillisecond;
  EXPECT_EQ(compiled(workload, mode(sched::Preemption::Full)).not_analysable, "");
  task.jitter = 10 * kMillisecond;
  EXPECT_THAT(compiled(workload, mode(sched::Preemption::Full)).not_analysable, HasSubstr("more than 18 years"));
}

TEST(TaskSet, WhatCutsOrRefusesJobsIsNotAnalysed) {
  Workload budget = two_dags();
  budget.dags[0].tasks[0].budget = kMillisecond;
  EXPECT_THAT(compiled(budget, mode(sched::Preemption::Full)).not_analysable, HasSubstr("budget"));
  Workload pending = two_dags();
  pending.dags[0].max_pending = 2;
  EXPECT_THAT(compiled(pending, mode(sched::Preemption::Full)).not_analysable, HasSubstr("max_pending"));
  AnalysisPlatform threads = mode(sched::Preemption::Full);
  threads.max_started = 2;
  EXPECT_THAT(compiled(two_dags(), threads).not_analysable, HasSubstr("2 threads serve up to 3 jobs in progress"));
  threads.max_started = 3;
  EXPECT_EQ(compiled(two_dags(), threads).not_analysable, "");
  EXPECT_TRUE(compiled(two_dags(), threads).threads_suffice_if_bounded);
  EXPECT_THAT(refusal(isolated(), two_dags(), threads), HasSubstr("fewer threads than tasks"));
  threads.max_started = 4;
  EXPECT_FALSE(compiled(two_dags(), threads).threads_suffice_if_bounded);
  EXPECT_EQ(compiled(two_dags(), threads).not_analysable, "");
}

TEST(TaskSet, OverlappingJobsOfOneTaskAreNotAnalysed) {
  Workload workload = two_dags();
  workload.dags[0].tasks[1].concurrency = 2;
  const TaskSet task_set = compiled(workload, mode(sched::Preemption::Full, 2));
  EXPECT_EQ(task_set.not_analysable, "task 'graph.b': jobs of a task with concurrency above 1 can overlap");
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(analyze(task_set).methods.at(0).outcome));
}

TEST(TaskSet, RegionsFollowTheMode) {
  Workload workload = two_dags();
  workload.dags[0].tasks[1].region = 2 * kMillisecond;
  EXPECT_EQ(compiled(workload, mode(sched::Preemption::Full)).tasks[1].region, 0);
  EXPECT_EQ(compiled(workload, mode(sched::Preemption::None)).tasks[1].region, 3 * kMillisecond);
  const TaskSet cooperative = compiled(workload, mode(sched::Preemption::Cooperative));
  EXPECT_EQ(cooperative.tasks[1].region, 2 * kMillisecond);
  EXPECT_EQ(cooperative.tasks[1].last_region, kMillisecond);
  EXPECT_EQ(cooperative.tasks[0].region, 2 * kMillisecond) << "without a region: the whole job";
  EXPECT_EQ(cooperative.mode, sched::Preemption::Cooperative);
  EXPECT_EQ(compiled(two_dags(), mode(sched::Preemption::Cooperative)).mode, sched::Preemption::None)
      << "no task has a preemption point";
}

TEST(TaskSet, BadInputIsAnError) {
  EXPECT_FALSE(compile(two_dags(), mode(sched::Preemption::Full, 0)));
  AnalysisPlatform negative = mode(sched::Preemption::Full);
  negative.release_overhead = -1;
  EXPECT_FALSE(compile(two_dags(), negative));
  Workload invalid = two_dags();
  invalid.dags[0].tasks[0].wcet = 0;
  EXPECT_FALSE(compile(invalid, mode(sched::Preemption::Full)));
}

TEST(NotApplicable, OneWorkerBounds) {
  const AnalysisPlatform full = mode(sched::Preemption::Full);
  EXPECT_THAT(refusal(rta_preemptive(), two_dags(), mode(sched::Preemption::Full, 2)), HasSubstr("one worker"));
  EXPECT_THAT(refusal(rta_nonpreemptive(), two_dags(), full), HasSubstr("preempted"));
  EXPECT_THAT(refusal(rta_preemptive(), two_dags(), mode(sched::Preemption::None)), HasSubstr("full"));
  EXPECT_EQ(refusal(rta_preemptive(), two_dags(), full), "");
  Workload edf = two_dags();
  edf.policy = PolicyKind::Edf;
  EXPECT_THAT(refusal(rta_preemptive(), edf, full), HasSubstr("static"));
  EXPECT_THAT(refusal(edf_demand(), edf, full), HasSubstr("predecessors"));
}

// A DAG's bound is not inherited. While a task of the DAG is preempted, one that is more urgent than all others can
// wait.
TEST(NotApplicable, MaxActiveOverSeveralUnits) {
  const auto workload = [](std::uint32_t max_active) {
    return make_workload({make_dag("d", {{.name = "a", .period = 5}, {.name = "b", .period = 50}}, max_active),
                          make_dag("e", {{.name = "c", .period = 10}})},
                         1);
  };
  EXPECT_THAT(refusal(rta_preemptive(), workload(1), mode(sched::Preemption::Full)), HasSubstr("max_active"));
  EXPECT_EQ(refusal(rta_preemptive(), workload(2), mode(sched::Preemption::Full)), "");
  EXPECT_EQ(refusal(rta_nonpreemptive(), workload(1), mode(sched::Preemption::None)), "");
}

TEST(NotApplicable, GroupsInCooperativeMode) {
  Workload workload = make_workload(
      {make_dag("d", {{.name = "a", .period = 5, .group = "g"}, {.name = "b", .period = 50, .wcet = 4, .group = "g"}})},
      1);
  workload.dags[0].tasks[1].region = kMillisecond;
  EXPECT_THAT(refusal(rta_deferred(), workload, mode(sched::Preemption::Cooperative)), HasSubstr("groups"));
  EXPECT_EQ(refusal(rta_nonpreemptive(), workload, mode(sched::Preemption::None)), "");
}

}  // namespace
}  // namespace redag::analysis
