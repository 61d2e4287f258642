// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/rate_edges.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>

#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/many_workers/global_groups.hpp"
#include "redag_analysis/many_workers/global_sequential.hpp"
#include "redag_analysis/many_workers/suspension_aware.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/repository.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;

BoundCaseLimits rates(sched::Preemption preemption, std::uint32_t workers) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.min_workers = workers == 1 ? 1 : 2;
  limits.max_workers = workers;
  limits.edges = limits.rates = true;
  limits.max_dags = 3;
  limits.min_utilization = 0.1;
  limits.max_utilization = workers == 1 ? 0.9 : 0.6;
  limits.jitter = limits.overheads = true;
  return limits;
}

// Draws a number of threads that is below the number of tasks.
testing::BoundGenerator few_threads(const BoundCaseLimits &limits) {
  return [limits](Rng &rng) {
    BoundCase bound_case = testing::random_bound_case(rng, limits);
    const auto tasks = static_cast<int>(bound_case.workload.task_count());
    bound_case.platform.max_started = static_cast<std::uint32_t>(rng.uniform((tasks + 1) / 2, tasks));
    return bound_case;
  };
}

BoundCaseLimits with_queues_and_groups(BoundCaseLimits limits) {
  limits.queues = limits.groups = limits.levels = true;
  return limits;
}

BoundCaseLimits with_max_active(BoundCaseLimits limits) {
  limits.caps = true;
  limits.max_dags = 2;
  return limits;
}

const testing::BoundPropertyOptions kFew{.workloads = 300, .runs = 6};

TEST(BoundProperty, RatesOneWorkerPreemptive) {
  expect_bound_holds(rta_preemptive(), cases(rates(sched::Preemption::Full, 1)), kFew);
}

TEST(BoundProperty, RatesOneWorkerPreemptiveWithEverything) {
  expect_bound_holds(rta_preemptive(), cases(with_queues_and_groups(rates(sched::Preemption::Full, 1))), kFew);
}

TEST(BoundProperty, RatesOneWorkerPreemptiveMaxActive) {
  expect_bound_holds(rta_preemptive(), cases(with_max_active(rates(sched::Preemption::Full, 1))), kFew);
}

TEST(BoundProperty, RatesOneWorkerNonpreemptive) {
  BoundCaseLimits limits = with_queues_and_groups(rates(sched::Preemption::None, 1));
  limits.levels = false;
  expect_bound_holds(rta_nonpreemptive(), cases(limits), kFew);
}

TEST(BoundProperty, RatesOneWorkerCooperative) {
  BoundCaseLimits limits = rates(sched::Preemption::Cooperative, 1);
  limits.queues = limits.levels = true;
  expect_bound_holds(rta_deferred(), cases(limits), kFew);
}

TEST(BoundProperty, RatesOfSingleTasksOneWorker) {
  expect_bound_holds(rta_preemptive(), cases(rates(sched::Preemption::Full, 1)), kFew);
  expect_bound_holds(rta_nonpreemptive(), cases(rates(sched::Preemption::None, 1)), kFew);
  expect_bound_holds(rta_deferred(), cases(rates(sched::Preemption::Cooperative, 1)), kFew);
}

TEST(BoundProperty, RatesDagBounded) {
  expect_bound_holds(dag_bounded(), cases(rates(sched::Preemption::Full, 4)), kFew);
}

TEST(BoundProperty, RatesDagBoundedMaxActive) {
  expect_bound_holds(dag_bounded(), cases(with_max_active(rates(sched::Preemption::Full, 4))), kFew);
}

TEST(BoundProperty, RatesDagBoundedFewThreads) {
  expect_bound_holds(dag_bounded(), few_threads(rates(sched::Preemption::Full, 4)), kFew);
}

TEST(BoundProperty, RatesDagNonpreemptive) {
  expect_bound_holds(dag_nonpreemptive(), cases(rates(sched::Preemption::None, 4)), kFew);
}

TEST(BoundProperty, RatesDagNonpreemptiveMaxActive) {
  expect_bound_holds(dag_nonpreemptive(), cases(with_max_active(rates(sched::Preemption::None, 4))), kFew);
}

testing::BoundGenerator with_waits(const BoundCaseLimits &limits) {
  return [limits](Rng &rng) {
    BoundCase bound_case = testing::random_bound_case(rng, limits);
    testing::add_waits(rng, bound_case.workload);
    return bound_case;
  };
}

TEST(BoundProperty, RatesOfTasksThatWait) {
  BoundCaseLimits limits = rates(sched::Preemption::Full, 3);
  limits.max_utilization = 0.5;
  expect_bound_holds(suspension_aware(), with_waits(limits), kFew);
  limits.preemption = sched::Preemption::None;
  expect_bound_holds(suspension_aware(), with_waits(limits), kFew);
  limits = rates(sched::Preemption::Full, 1);
  limits.max_utilization = 0.5;
  expect_bound_holds(rta_preemptive(), with_waits(limits), kFew);
}

TEST(BoundProperty, RatesDagGroups) {
  BoundCaseLimits limits = rates(sched::Preemption::None, 4);
  limits.groups = true;
  expect_bound_holds(dag_groups(), cases(limits), kFew);
}

TEST(BoundProperty, RatesOfSingleTasks) {
  BoundCaseLimits limits = rates(sched::Preemption::Full, 4);
  expect_bound_holds(guan(), cases(limits), kFew);
  limits.preemption = sched::Preemption::None;
  expect_bound_holds(sequential_nonpreemptive(), cases(limits), kFew);
}

// ---- by hand ----

using redag::testing::make_dag;
using redag::testing::make_workload;

TaskSet compiled(const Workload &workload, std::uint32_t workers = 1, std::uint32_t threads = 0) {
  AnalysisPlatform platform;
  platform.workers = workers;
  platform.max_started = threads;
  return testing::compiled(workload, platform);
}

Bound bound_of(const Method &method, const TaskSet &task_set) {
  const Outcome outcome = method.apply(task_set);
  const auto *bound = std::get_if<Bound>(&outcome);
  EXPECT_NE(bound, nullptr) << std::get<NotApplicable>(outcome).reason;
  return bound == nullptr ? Bound{} : *bound;
}

std::optional<Duration> milliseconds(const ResponseBound &bound) {
  if (!bound.response) return std::nullopt;
  Duration sum = 0;
  for (const Term &term : bound.terms) sum += term.amount;
  EXPECT_EQ(sum, *bound.response) << "the terms add up";
  return *bound.response / kMillisecond;
}

// A camera every 10 ms (R = 1) and a lidar every 40 ms (R = 5) are fused. A picture comes within 10 + 1 of the last
// one, and therefore only the first wait counts: the fusion is ready as soon as the lidar's data are there.
TEST(RateEdges, DataOfAFastPredecessorAreThereWhenTheSlowOneEnds) {
  Workload workload = make_workload({make_dag("d", {{.name = "camera", .period = 10},
                                                    {.name = "lidar", .period = 40, .wcet = 4},
                                                    {.name = "fuse", .wcet = 3, .after = {0, 1}, .deadline = 5}})},
                                    1);
  EXPECT_EQ(milliseconds(bound_of(rta_preemptive(), compiled(workload)).tasks[1]), 8) << "fuse is its equal";
  workload.ties = Ties::Fixed;
  const TaskSet task_set = compiled(workload);
  const Bound bound = bound_of(rta_preemptive(), task_set);
  EXPECT_EQ(milliseconds(bound.tasks[0]), 1);
  EXPECT_EQ(milliseconds(bound.tasks[1]), 5);
  // Camera and lidar can arrive while it executes; from its own release, R = 3 + 1 + 4.
  EXPECT_EQ(milliseconds(bound.tasks[2]), 8);
  EXPECT_FALSE(meets_deadline(task_set.tasks[2], bound.tasks[2]));
  // It takes the latest picture: the next one comes at most 10 + 1 after the release of that one.
  EXPECT_EQ(milliseconds(bound.dags[0]), 8 + 11);
  EXPECT_EQ(bound.dags[0].sum(Term::Kind::Wait), 11 * kMillisecond);
}

// b is released 3 before its predecessor, which answers after 2. It waits 5 in its first period, and thus in all.
TEST(RateEdges, ATimerWaitsForDataOfAnotherOffset) {
  Workload workload = make_workload({make_dag("d", {{.name = "a", .period = 20, .wcet = 2, .offset = 3},
                                                    {.name = "b", .period = 20, .wcet = 4, .after = {0}}})},
                                    1);
  workload.ties = Ties::Fixed;  // with shared ties b would also delay a
  const TaskSet task_set = compiled(workload);
  const Bound bound = bound_of(rta_preemptive(), task_set);
  EXPECT_EQ(milliseconds(bound.tasks[1]), 5 + 4 + 2);
  EXPECT_EQ(bound.tasks[1].sum(Term::Kind::Wait), 5 * kMillisecond);
}

// The fast timer's jobs are skipped for lack of data by design. The others are bounded with as many of its jobs as can
// become ready.
TEST(RateEdges, ATimerThatIsFasterThanItsDataIsNotBoundedAndOthersAre) {
  const TaskSet task_set = compiled(make_workload(
      {make_dag("d", {{.name = "a", .period = 20, .wcet = 2}, {.name = "b", .period = 10, .wcet = 1, .after = {0}}}),
       make_dag("e", {{.name = "c", .period = 40, .wcet = 1}})},
      1));
  const Bound bound = bound_of(rta_preemptive(), task_set);
  EXPECT_FALSE(bound.tasks[1].response);
  EXPECT_THAT(bound.tasks[1].absent, ::testing::HasSubstr("skipped by design"));
  EXPECT_EQ(milliseconds(bound.tasks[2]), 1 + 2 + 2) << "two jobs of b: one was released a period before";
  EXPECT_FALSE(bound.dags[0].response);
  EXPECT_EQ(verdict(task_set, bound), Verdict::NotShown);
}

// Two chains with one job in progress each: two threads, or a max_active of two, suffice if all tasks are bounded.
TEST(RateEdges, WhatCannotBindIsNoObstacle) {
  const auto workload = [](std::uint32_t max_active) {
    return make_workload({make_dag("d",
                                   {{.name = "a", .period = 10},
                                    {.name = "b", .after = {0}},
                                    {.name = "c", .period = 30},
                                    {.name = "e", .after = {2, 0}}},
                                   max_active)},
                         2);
  };
  const TaskSet two = compiled(workload(2), 2, 2);
  EXPECT_EQ(verdict(two, bound_of(dag_bounded(), two)), Verdict::Schedulable);
  const Outcome one = dag_bounded().apply(compiled(workload(1), 2));
  ASSERT_TRUE(std::holds_alternative<NotApplicable>(one));
  EXPECT_THAT(std::get<NotApplicable>(one).reason, ::testing::HasSubstr("max_active"));
  EXPECT_THAT(compiled(workload(0), 2, 1).not_analysable, ::testing::HasSubstr("threads"));

  Workload slow = workload(2);
  slow.dags[0].tasks[3].wcet = 30 * kMillisecond;
  for (const ResponseBound &none : bound_of(dag_bounded(), compiled(slow, 2)).tasks) EXPECT_FALSE(none.response);
}

// Two sources of one period feed a task.
Workload two_sources(Phase first, Phase second, std::uint32_t workers) {
  Workload workload = make_workload(
      {make_dag("d", {{.name = "x", .period = 10}, {.name = "y", .period = 10}, {.name = "j", .after = {0, 1}}})},
      workers, PreemptionMode::Os);
  workload.dags[0].tasks[0].phase = first;
  workload.dags[0].tasks[1].phase = second;
  return workload;
}

// y at 0 ends at 1. x at 9.9 ends at 10.9, and then j runs on y's data of 0. Every 10 ms anew.
TEST(RateEdges, SourcesOfTwoClocksAreNotReleasedTogether) {
  const TaskSet together = compiled(two_sources(Phase::Common, Phase::Common, 2), 2);
  EXPECT_FALSE(together.has_rate_edges());
  EXPECT_EQ(milliseconds(bound_of(dag_bounded(), together).dags[0]), 2);
  for (const Phase phase : {Phase::Unknown, Phase::Event}) {
    const TaskSet task_set = compiled(two_sources(phase, Phase::Common, 2), 2);
    ASSERT_EQ(task_set.units.size(), 3U);
    const Bound bound = bound_of(dag_bounded(), task_set);
    // x and y answer within 1 + 1, as three tasks share two workers, and j does so from when it is ready.
    EXPECT_EQ(milliseconds(bound.tasks[0]), 2);
    EXPECT_EQ(milliseconds(bound.tasks[2]), 2);
    // Data of y are at most 10 + 2 old. Those of x wait for them for 11.999999 ms at most.
    EXPECT_EQ(milliseconds(bound.dags[0]), phase == Phase::Event ? 15 : 14);
    for (const MethodReport &report : analyze(task_set).methods) {
      const Bound *other = report.trusted ? report.bound() : nullptr;
      if (other == nullptr || other->dags.empty() || !other->dags[0].response) continue;
      EXPECT_GE(*other->dags[0].response, 11'900'000) << report.method->name;
    }
  }
}

// Nothing bounds how long one event waits for the other.
TEST(RateEdges, TwoEventsThatAreJoinedHaveNoBoundEndToEnd) {
  const TaskSet task_set = compiled(two_sources(Phase::Event, Phase::Event, 2), 2);
  const Bound bound = bound_of(dag_bounded(), task_set);
  EXPECT_EQ(milliseconds(bound.tasks[2]), 2) << "from its own release";
  EXPECT_FALSE(bound.dags[0].response);
  EXPECT_THAT(bound.dags[0].absent, ::testing::HasSubstr("how long other data wait"));
  Workload workload = two_sources(Phase::Event, Phase::Common, 2);
  workload.dags[0].tasks[1].period = workload.dags[0].tasks[2].period = 30 * kMillisecond;
  const Bound fast = bound_of(dag_bounded(), compiled(workload, 2));
  EXPECT_FALSE(fast.tasks[2].response);
  EXPECT_THAT(fast.tasks[2].absent, ::testing::HasSubstr("a shorter period that come by events"));
}

// A timer whose data come from another clock is ready once per period only if they come more often.
TEST(RateEdges, ATimerWaitsForDataOfAnotherClock) {
  const auto bound = [](Duration fast) {
    Workload workload =
        make_workload({make_dag("d", {{.name = "x", .period = fast}, {.name = "z", .period = 20, .after = {0}}})}, 2,
                      PreemptionMode::Os);
    workload.dags[0].tasks[0].phase = Phase::Unknown;
    workload.dags[0].tasks[1].offset = kMillisecond;
    return bound_of(dag_bounded(), compiled(workload, 2)).tasks[1];
  };
  // Data every 5 ms, 1 ms late at most: z is ready within 5.999999 ms. x fills only one of the two workers.
  EXPECT_EQ(bound(5).response, 5'999'999 + 1'000'000);
  EXPECT_FALSE(bound(20).response);
  EXPECT_THAT(bound(20).absent, ::testing::HasSubstr("nothing synchronises its timer"));
}

// Tasks that follow a join of two clocks are released with it: they are one unit.
TEST(RateEdges, WhatFollowsAJoinOfTwoClocksIsItsUnit) {
  Workload workload = two_sources(Phase::Unknown, Phase::Unknown, 2);
  Task last = workload.dags[0].tasks[2];
  last.name = "last";
  last.predecessors = {2};
  workload.dags[0].tasks.push_back(last);
  const TaskSet task_set = compiled(workload, 2);
  EXPECT_EQ(task_set.units.size(), 3U);
  EXPECT_EQ(task_set.tasks[2].unit, task_set.tasks[3].unit);
  const Bound bound = bound_of(dag_bounded(), task_set);
  ASSERT_TRUE(bound.dags[0].response);
  EXPECT_EQ(*bound.dags[0].response, 10'000'000 + 2'000'000 + 3'000'000);
}

// Each ROS timer counts from when its node created it, and messages come when another process sends them.
TEST(RateEdges, CallbacksOfRosHaveNoCommonClock) {
  constexpr auto kFusion = R"(
platform: {workers: 2, preemption: os}
dags:
  - name: fusion
    tasks:
      - {name: scan, wcet: 1ms, period: 50ms, callback: {node: /lidar, subscription: /scan}}
      - {name: imu, wcet: 1ms, period: 50ms, callback: {node: /imu, timer: 50ms}}
      - {name: fuse, wcet: 1ms, activation: data, after: [scan, imu], callback: {node: /fuse, subscription: /x}}
)";
  Workload workload = parse_workload(kFusion, "w.yaml").value().workload;
  EXPECT_EQ(milliseconds(bound_of(dag_bounded(), compiled(workload, 2)).dags[0]), 50 + 2 + 2);
  workload.dags[0].tasks[0].callback->kind = Callback::Kind::Service;
  EXPECT_EQ(compiled(workload, 2).tasks[0].has_gaps, true);
}

// A timer of each process: no time at which both begin is known.
TEST(RateEdges, ExecutorsHaveNoCommonClock) {
  Workload workload = two_sources(Phase::Common, Phase::Common, 2);
  workload.dags.push_back(make_dag("e", {{.name = "z", .period = 10}}));
  EXPECT_EQ(compiled(workload, 2).tasks[3].clock, compiled(workload, 2).tasks[0].clock);
  workload.dags[1].executor = 1;
  EXPECT_NE(compiled(workload, 2).tasks[3].clock, compiled(workload, 2).tasks[0].clock);
}

TEST(RateEdges, OtherMethodsRefuseThem) {
  const Workload workload =
      make_workload({make_dag("d", {{.name = "a", .period = 5}, {.name = "b", .period = 10, .after = {0}}})}, 1);
  constexpr std::string_view kKnow[] = {"rta_preemptive", "dag_bounded", "guan", "dag_shapes"};
  for (const std::uint32_t workers : {1U, 2U}) {
    for (const MethodReport &report : analyze(compiled(workload, workers)).methods) {
      if (std::find(std::begin(kKnow), std::end(kKnow), report.method->name) != std::end(kKnow)) continue;
      EXPECT_FALSE(report.trusted) << report.method->name;
    }
  }
}

TEST(RateEdges, TheProjectsOwnWorkloadsAreSchedulable) {
  for (const char *name :
       {"contention", "paper/harmonic_u06", "paper/harmonic_u08", "paper/nonharmonic_u06", "paper/nonharmonic_u08"}) {
    const auto loaded = load_workload((testing::repository() / "workloads" / (std::string(name) + ".yaml")).string());
    ASSERT_TRUE(loaded) << name;
    const auto task_set = compile(loaded->workload, platform_of(loaded->workload));
    ASSERT_TRUE(task_set) << name;
    EXPECT_EQ(analyze(*task_set).verdict, Verdict::Schedulable) << name;
  }
}

}  // namespace
}  // namespace redag::analysis
