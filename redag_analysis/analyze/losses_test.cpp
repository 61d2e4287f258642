// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a machine takes from jobs (AnalysisPlatform::stall, lateness, preempt_overhead on several workers) is charged by
// compile() as jitter. No simulated response with such losses exceeds a bound that includes them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <variant>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/any_features/by_demand.hpp"
#include "redag_analysis/many_workers/dag_shapes.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/many_workers/global_groups.hpp"
#include "redag_analysis/many_workers/suspension_aware.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::BoundGenerator;
using ::testing::HasSubstr;

BoundCaseLimits limits_for(std::uint32_t workers) {
  BoundCaseLimits limits;
  limits.min_workers = limits.max_workers = workers;
  limits.policies = {PolicyKind::RateMonotonic};  // stalls have the shortest period of all
  limits.min_period = 12;
  limits.max_period = 120;
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.5;
  limits.jitter = true;
  return limits;
}

// Adds stalls, late releases and costs of preemption to random cases.
BoundGenerator with_losses(const BoundCaseLimits &limits) {
  return [limits](Rng &rng) {
    BoundCase bound_case = testing::random_bound_case(rng, limits);
    AnalysisPlatform &platform = bound_case.platform;
    platform.stall.longest = rng.uniform(0, 3);
    if (rng.uniform(0, 1) == 1) platform.stall.per_second = rng.uniform(1, 40) * kMillisecond;
    platform.lateness = rng.uniform(0, 2);
    platform.preempt_overhead = rng.uniform(0, 1);
    return bound_case;
  };
}

TEST(Losses, OneWorker) { testing::expect_bound_holds(rta_preemptive(), with_losses(limits_for(1))); }

TEST(Losses, OneWorkerDags) {
  BoundCaseLimits limits = limits_for(1);
  limits.edges = true;
  testing::expect_bound_holds(rta_preemptive(), with_losses(limits));
}

TEST(Losses, OneWorkerRateEdges) {
  BoundCaseLimits limits = limits_for(1);
  limits.edges = limits.rates = true;
  testing::expect_bound_holds(rta_preemptive(), with_losses(limits));
}

TEST(Losses, SeveralWorkers) { testing::expect_bound_holds(dag_bounded(), with_losses(limits_for(2))); }

TEST(Losses, SeveralWorkersDags) {
  BoundCaseLimits limits = limits_for(3);
  limits.edges = true;
  testing::expect_bound_holds(dag_bounded(), with_losses(limits));
}

TEST(Losses, SeveralWorkersRateEdges) {
  BoundCaseLimits limits = limits_for(2);
  limits.edges = limits.rates = true;
  testing::expect_bound_holds(dag_shapes(), with_losses(limits));
}

// A job that waits for its group can make the holder preempt, and can preempt when it starts itself.
TEST(Losses, SeveralWorkersGroups) {
  BoundCaseLimits limits = limits_for(3);
  limits.min_workers = 2;
  limits.groups = true;
  testing::expect_bound_holds(dag_groups(), with_losses(limits));
  limits.edges = true;
  limits.max_deadline = 4;
  testing::expect_bound_holds(dag_groups(), with_losses(limits));
}

BoundGenerator with_losses_and_waits(const BoundCaseLimits &limits) {
  return [draw = with_losses(limits)](Rng &rng) {
    BoundCase bound_case = draw(rng);
    testing::add_waits(rng, bound_case.workload);
    return bound_case;
  };
}

// Jobs also resume after their waits, and each wake-up can preempt another job.
TEST(Losses, OfJobsThatWait) {
  for (const std::uint32_t workers : {1U, 3U}) {
    BoundCaseLimits limits = limits_for(workers);
    limits.max_utilization = 0.4;
    testing::expect_bound_holds(suspension_aware(), with_losses_and_waits(limits), {.workloads = 500});
    limits.edges = true;
    testing::expect_bound_holds(suspension_aware(), with_losses_and_waits(limits), {.workloads = 500});
    testing::expect_bound_holds(suspension_aware_any(), with_losses_and_waits(limits), {.workloads = 200});
  }
  testing::expect_bound_holds(rta_preemptive(), with_losses_and_waits(limits_for(1)), {.workloads = 500});
}

Workload one_task() {
  Workload workload = testing::make_workload({testing::make_dag("d", {{"t", 10, 2}})});
  workload.dags[0].tasks[0].jitter = 5;
  return workload;
}

TEST(Losses, WhatIsCharged) {
  AnalysisPlatform platform;
  platform.workers = 2;
  platform.lateness = 100;
  platform.timer_overhead = 7;
  platform.preempt_overhead = 1000;
  platform.stall = {.longest = 20'000, .per_second = 0};
  const Result<TaskSet> task_set = compile(one_task(), platform);
  ASSERT_TRUE(task_set);
  EXPECT_EQ(task_set->not_analysable, "");
  // 2 stalls. 2 releases: that of its period and one due to jitter. 4 preemptions: two more, by a job before and by a
  // waiting one. Of 1 s the timer takes 700 ns, preemptions take 100 us.
  EXPECT_EQ(task_set->frozen, 44'019) << "ceil((2 * 20'000 + 2 * 7 + 4 * 1000) / (1 - 100'700 / 1e9))";
  EXPECT_EQ(task_set->tasks[0].jitter, 5 + 100 + task_set->frozen);
  EXPECT_EQ(task_set->tasks[0].wcet, 2'000'202) << "ceil(2 ms / (1 - 100'700 / 1e9))";
  EXPECT_EQ(task_set->tasks[0].overhead, 202);
}

TEST(Losses, OnOneWorkerWhoPreemptsPays) {
  AnalysisPlatform platform;
  platform.preempt_overhead = 1000;
  const Result<TaskSet> task_set = compile(one_task(), platform);
  ASSERT_TRUE(task_set);
  EXPECT_EQ(task_set->frozen, 0);
  EXPECT_EQ(task_set->tasks[0].wcet, 2'001'000);
}

TEST(Losses, AJobThatWaitsResumesAndPreemptsOnceMore) {
  AnalysisPlatform platform;
  platform.preempt_overhead = 1000;
  Workload workload = one_task();
  workload.dags[0].tasks[0].waits = {Wait{kMillisecond, 3 * kMillisecond, 0, {}}};
  const Result<TaskSet> task_set = compile(workload, platform);
  ASSERT_TRUE(task_set);
  // 4 releases, each with 2 preemptions; of 1 s these take 200 us.
  EXPECT_EQ(task_set->frozen, 8'002) << "ceil(4 * 2 * 1000 / (1 - 200'000 / 1e9))";
  EXPECT_EQ(task_set->tasks[0].waits, 3'000'601) << "ceil(3 ms / (1 - 200'000 / 1e9))";
  EXPECT_EQ(task_set->tasks[0].wcet - task_set->tasks[0].waits, 2'001'401) << "ceil((2 ms + 1 us) / the same)";
}

// Without a bound of the responses, data tasks have a job for all that was unfinished before them.
TEST(Losses, WhatIsBehindPreemptsLater) {
  AnalysisPlatform platform;
  platform.workers = 2;
  platform.preempt_overhead = 1000;
  const Workload chain = testing::make_workload({testing::make_dag("d", {{"a", 10, 2}, {"b", 0, 1, {0}}})}, 2);
  const Result<TaskSet> task_set = compile(chain, platform);
  ASSERT_TRUE(task_set);
  EXPECT_EQ(task_set->frozen, 6'002) << "ceil(2 * 3 * 1000 / (1 - 200'000 / 1e9))";
  EXPECT_EQ(task_set->frozen_behind, 7'002) << "ceil((2 * 5 - 3) * 1000 / the same)";
  TaskSet without = *task_set;
  without.frozen_behind = 0;
  const auto response = [](const TaskSet &set) {
    return std::get<Bound>(by_demand().apply(set)).tasks[0].response.value_or(0);
  };
  EXPECT_EQ(response(*task_set) - response(without), 7'002);
}

TEST(Losses, HoldersThatInheritOftenPreemptAtEachEvent) {
  AnalysisPlatform platform;
  platform.workers = 2;
  platform.preempt_overhead = 1000;
  Workload workload = testing::make_workload({testing::make_dag("d", {{"a", 10, 2}, {"b", 20, 1}})}, 2);
  for (Task &task : workload.dags[0].tasks) task.group = "g";
  EXPECT_EQ(compile(workload, platform)->frozen, 12'004) << "ceil(2 * 3 * 2 * 1000 / (1 - 300'000 / 1e9))";
  workload.dags[0].max_active = 1;
  EXPECT_EQ(compile(workload, platform)->frozen, 18'009) << "ceil(2 * 3 * (2 + 1) * 1000 / (1 - 450'000 / 1e9))";
}

TEST(Losses, NothingIsLeft) {
  AnalysisPlatform platform;
  platform.workers = 4;
  platform.stall.per_second = 250 * kMillisecond;
  EXPECT_THAT(compile(one_task(), platform)->not_analysable, HasSubstr("no processor time"));
  platform.stall.per_second = -1;
  EXPECT_FALSE(compile(one_task(), platform));
}

}  // namespace
}  // namespace redag::analysis
