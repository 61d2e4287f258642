// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/tune.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "redag/model/validate.hpp"
#include "redag_testing/builders.hpp"

namespace redag::lab {
namespace {

using testing::make_dag;
using testing::make_workload;

// Returns a small and often overloaded workload, for which some setting matters. Apart from contended(): with two or
// three DAGs of at most three tasks, the search can try all settings.
Workload random_workload(std::uint64_t seed) {
  Rng rng(seed);
  std::vector<Dag> dags;
  const auto count = static_cast<int>(rng.uniform(2, 3));
  for (int d = 0; d < count; ++d) {
    const Duration period = 10 * rng.uniform(1, 2);
    std::vector<testing::TestTask> tasks = {{"s", period, rng.uniform(1, 6)}};
    if (rng.uniform(0, 1) == 1) tasks.push_back({"l", 0, rng.uniform(1, 5), {0}});
    if (rng.uniform(0, 1) == 1) tasks.push_back({"r", 0, rng.uniform(1, 5), {0}});
    dags.push_back(make_dag("d" + std::to_string(d), tasks));
    dags.back().criticality = static_cast<Criticality>(rng.uniform(0, 2));
  }
  Workload workload = make_workload(std::move(dags), static_cast<std::uint32_t>(rng.uniform(1, 2)),
                                    rng.uniform(0, 1) == 0 ? PreemptionMode::None : PreemptionMode::Os);
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      task.bcet = task.wcet / 2;
      task.execution.kind = ExecutionTime::Kind::Uniform;
    }
  }
  return workload;
}

TuneOptions quick(Objective objective = Objective::Misses) {
  TuneOptions options;
  options.goal.objective = objective;
  options.simulation.duration = 400 * kMillisecond;
  options.seeds = 2;
  options.held_out = 3;
  return options;
}

RunScore score_of(const Workload &workload, const TuneOptions &options, std::uint64_t first_seed, std::uint32_t seeds) {
  RunScore score;
  for (std::uint32_t s = 0; s < seeds; ++s) {
    const auto run = simulate_once(workload, first_seed + s, options.simulation, nullptr);
    for (std::size_t c = 0; c < kCriticalities; ++c) score.of[c].add((*run)[c]);
  }
  return score;
}

std::vector<Point> all_points(const SettingSpace &settings) {
  std::vector<Point> points = {{}};
  for (const auto &values : settings.space().values) {
    std::vector<Point> longer;
    for (const Point &point : points) {
      for (const std::uint32_t value : values) {
        longer.push_back(point);
        longer.back().push_back(value);
      }
    }
    points = std::move(longer);
  }
  return points;
}

TEST(Tune, NeverReturnsWorseThanItWasGiven) {
  int changed = 0;
  for (std::uint64_t i = 0; i < 60; ++i) {
    const Workload workload = random_workload(i);
    TuneOptions options = quick(static_cast<Objective>(i % 3));
    options.goal.per_criticality = i % 2 == 0;
    options.bounds = i % 5 == 0;
    options.effort.exhaustive = i % 4 == 0 ? 0 : 1024;
    const auto tuned = tune(workload, options);
    ASSERT_TRUE(tuned);
    EXPECT_EQ(tuned->present.workload, workload);
    // Computes the scores again from the resulting workload alone.
    const auto judged = [&](const SettingCandidate &candidate, std::uint64_t first, std::uint32_t seeds) {
      RunScore score = score_of(candidate.workload, options, first, seeds);
      score.proven = candidate.score.proven;
      return score;
    };
    EXPECT_FALSE(improves(judged(tuned->present, 1, 2), judged(tuned->best, 1, 2), options.goal)) << i;
    EXPECT_FALSE(improves(judged(tuned->present, 3, 3), judged(tuned->best, 3, 3), options.goal)) << i;
    EXPECT_FALSE(has_errors(validate(tuned->best.workload)));
    changed += tuned->changed() ? 1 : 0;
  }
  EXPECT_GT(changed, 10) << "nothing to tune: the property says nothing";
}

TEST(Tune, TheBestIsThatOfBruteForce) {
  for (std::uint64_t i = 0; i < 15; ++i) {
    const Workload workload = random_workload(100 + i);
    TuneOptions options = quick(static_cast<Objective>(i % 3));
    options.bounds = false;
    options.held_out = 0;
    const SettingSpace settings(workload, options.freedom);
    std::optional<RunScore> best;
    for (const Point &point : all_points(settings)) {
      const RunScore score = score_of(settings.apply(point), options, 1, 2);
      if (!best || improves(score, *best, options.goal)) best = score;
    }
    const auto tuned = tune(workload, options);
    ASSERT_TRUE(tuned);
    EXPECT_TRUE(tuned->exhaustive);
    EXPECT_EQ(tuned->trials.size(), all_points(settings).size());
    EXPECT_FALSE(improves(*best, tuned->best.score, options.goal)) << i;
    EXPECT_FALSE(improves(tuned->best.score, *best, options.goal)) << i;
  }
}

TEST(Tune, LocalSearchIsNeverBelowItsStartsAndMostlyFindsTheBest) {
  int equal = 0;
  for (std::uint64_t i = 0; i < 15; ++i) {
    const Workload workload = random_workload(200 + i);
    TuneOptions options = quick();
    options.bounds = false;
    options.held_out = 0;
    const auto exact = tune(workload, options);
    options.effort.exhaustive = 0;
    const auto local = tune(workload, options);
    EXPECT_FALSE(local->exhaustive);
    EXPECT_FALSE(improves(local->best.score, exact->best.score, options.goal));
    equal += improves(exact->best.score, local->best.score, options.goal) ? 0 : 1;
  }
  EXPECT_GE(equal, 13);
}

TEST(Tune, TheSameForEveryNumberOfProcessors) {
  const Workload workload = random_workload(7);
  TuneOptions options = quick();
  options.jobs = 1;
  const auto one = tune(workload, options);
  options.jobs = 4;
  const auto four = tune(workload, options);
  EXPECT_EQ(one->trials, four->trials);
  EXPECT_EQ(one->best.point, four->best.point);
  EXPECT_EQ(one->best.held_out_runs, four->best.held_out_runs);
}

// Returns two DAGs of one rate on one worker. The second one has the shorter deadline.
Workload tie() {
  return make_workload({make_dag("long", {{"t", 20, 8}}), make_dag("short", {{"t", 20, 4, {}, "", 0, 6}})}, 1,
                       PreemptionMode::Os);
}

TEST(Tune, TieOrder) {
  TuneOptions options = quick();
  options.freedom.workers = false;
  const auto tuned = tune(tie(), options);
  ASSERT_TRUE(tuned->changed());
  EXPECT_EQ(tuned->present.score.all().missed, 40U);
  EXPECT_EQ(tuned->best.score.all().missed, 0U);
  EXPECT_TRUE(tuned->best.score.proven);
  EXPECT_EQ(tuned->best.workload.policy, PolicyKind::Fixed);
  EXPECT_GT(*tuned->best.workload.dags[1].tasks[0].priority, *tuned->best.workload.dags[0].tasks[0].priority);
  EXPECT_FALSE(tuned->varies);
  options.freedom.ties = false;
  EXPECT_FALSE(tune(tie(), options)->changed());
}

// Times vary, but no job is late with any seed, and all seeds score the same.
TEST(Tune, WhatVariesIsDecidedByTheWorkload) {
  Workload workload =
      make_workload({make_dag("a", {{"t", 20, 4}}), make_dag("b", {{"t", 40, 4}})}, 2, PreemptionMode::Os);
  EXPECT_FALSE(tune(workload, quick())->varies);
  Task &task = workload.dags[1].tasks[0];
  task.execution.kind = ExecutionTime::Kind::Uniform;
  task.bcet = task.wcet;
  EXPECT_FALSE(tune(workload, quick())->varies);
  task.bcet = task.wcet / 2;
  const auto tuned = tune(workload, quick());
  EXPECT_TRUE(tuned->varies);
  EXPECT_EQ(tuned->best.score.all().missed, 0U);
  task.execution = {};
  task.jitter = kMillisecond;
  EXPECT_TRUE(tune(workload, quick())->varies);
}

TEST(Tune, WorkersWithinTheLimit) {
  const Workload workload = tie();
  TuneOptions options = quick();
  options.bounds = false;
  options.freedom.ties = false;
  EXPECT_FALSE(tune(workload, options)->changed());
  options.freedom.most_workers = 3;
  const auto tuned = tune(workload, options);
  EXPECT_EQ(tuned->best.workload.platform.workers, 2U);  // not three, which improve nothing further
}

TEST(Tune, TheMostCriticalFirst) {
  // One worker has two jobs in 20 ms, and only one of them can be in time.
  Workload workload = make_workload({make_dag("a", {{"t", 20, 8, {}, "", 0, 9}, {"u", 20, 1, {}, "", 0, 10}}),
                                     make_dag("b", {{"t", 20, 4, {}, "", 0, 6}})},
                                    1);
  workload.dags[0].criticality = Criticality::Low;
  workload.dags[1].criticality = Criticality::High;
  TuneOptions options = quick();
  options.goal.per_criticality = true;
  const auto critical = tune(workload, options);
  EXPECT_EQ(critical->best.score.of[static_cast<std::size_t>(Criticality::High)].missed, 0U);
  EXPECT_EQ(critical->best.score.of[static_cast<std::size_t>(Criticality::Low)].missed, 80U);
  options.goal.per_criticality = false;
  const auto all = tune(workload, options);
  EXPECT_EQ(all->best.score.all().missed, 40U);
}

TEST(Tune, AProofComesFirst) {
  RunScore proven;
  proven.proven = true;
  proven.of[1] = {10, 0, 0, -1, 0.1, true};
  RunScore faster;
  faster.of[1] = {10, 0, 0, -5, 0.5, true};
  EXPECT_TRUE(improves(proven, faster, {Objective::Lateness, false}));
  EXPECT_FALSE(improves(faster, proven, {Objective::Lateness, false}));
  faster.proven = true;
  EXPECT_TRUE(improves(faster, proven, {Objective::Lateness, false}));
  EXPECT_FALSE(improves(faster, proven, {Objective::Misses, false}));
  EXPECT_TRUE(is_better(faster, proven, {Objective::Misses, false}));
}

TEST(Tune, StoppedBeforeAnything) {
  const std::atomic<bool> stop{true};
  TuneOptions options = quick();
  options.stop = &stop;
  EXPECT_FALSE(tune(random_workload(1), options));
}

TEST(Tune, StoppedLaterGivesTheBestSoFar) {
  std::atomic<bool> stop{false};
  TuneOptions options = quick();
  options.stop = &stop;
  options.effort.exhaustive = 0;
  options.progress = [&stop](std::uint64_t tried) { stop = tried > 1; };
  const auto tuned = tune(random_workload(1), options);
  ASSERT_TRUE(tuned);
  EXPECT_TRUE(tuned->stopped);
  EXPECT_GT(tuned->trials.size(), 1U);
  EXPECT_EQ(tuned->best.held_out_runs.size(), 3U);
}

TEST(Setting, EveryOrderOfTiedDagsOnce) {
  Workload workload = make_workload(
      {make_dag("a", {{"t", 10}}), make_dag("b", {{"t", 10}}), make_dag("c", {{"t", 20}}), make_dag("d", {{"t", 10}})},
      1);
  const SettingSpace settings(workload, {false, false, true, 0, {}});
  std::set<std::vector<std::uint32_t>> orders;
  for (const Point &point : all_points(settings)) orders.insert(settings.tie_order(point));
  EXPECT_EQ(orders.size(), 6U);
  EXPECT_EQ(all_points(settings).size(), 6U);
  for (const auto &order : orders) EXPECT_THAT(order, ::testing::UnorderedElementsAre(0, 1, 3));
  EXPECT_EQ(settings.apply(settings.space().starts.front()), workload);
}

TEST(Setting, AnOtherOrderKeepsTheRates) {
  Workload workload =
      make_workload({make_dag("a", {{"t", 10}, {"u", 0, 1, {0}}}), make_dag("b", {{"t", 10}, {"v", 5}})}, 1);
  const SettingSpace settings(workload, {false, false, true, 0, {}});
  Point point = settings.space().starts.front();
  point.back() = 1;
  const Workload other = settings.apply(point);
  EXPECT_EQ(other.policy, PolicyKind::Fixed);
  EXPECT_EQ(other.dags[1].tasks[1].priority, 3);  // 5 ms
  EXPECT_EQ(other.dags[1].tasks[0].priority, 2);
  EXPECT_EQ(other.dags[0].tasks[0].priority, 1);
  EXPECT_EQ(other.dags[0].tasks[1].priority, 1);
}

TEST(Setting, TheRangeOfCaps) {
  const Workload workload = make_workload({make_dag("a", {{"t", 10}}), make_dag("b", {{"t", 10}})}, 4);
  Freedom freedom;
  freedom.workers = freedom.ties = false;
  freedom.cap_range = {2, 5};
  const SettingSpace settings(workload, freedom);
  EXPECT_THAT(settings.space().values[1], ::testing::ElementsAre(0, 2, 3, 4, 5));
  EXPECT_THAT(settings.space().values[0], ::testing::ElementsAre(4));
}

}  // namespace
}  // namespace redag::lab
