// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/tune.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::lab {
namespace {

using testing::independent;
using testing::make_dag;
using testing::make_workload;
using testing::tick_dag;

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

TuneOptions quick() {
  TuneOptions options;
  options.simulation.duration = 400 * kMillisecond;
  options.seeds = 2;
  options.held_out = 3;
  return options;
}

Score score_of(const Workload &workload, const TuneOptions &options, std::uint64_t first_seed, std::uint32_t seeds) {
  Score score;
  for (std::uint32_t s = 0; s < seeds; ++s) {
    score.add(*score_of_run(workload, first_seed + s, options.simulation, nullptr));
  }
  return score;
}

// Returns the settings of a workload whose priorities do not change.
SettingSpace settings_of(const Workload &workload, const Freedom &freedom) {
  return {workload, freedom, {{"present", workload}}};
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
  for (std::uint64_t i = 0; i < 120; ++i) {
    const Workload workload = random_workload(i);
    TuneOptions options = quick();
    options.exhaustive = i % 4 == 0 ? 0 : 1024;
    options.freedom.priorities = true;
    const auto tuned = tune(workload, options);
    ASSERT_TRUE(tuned);
    EXPECT_EQ(tuned->present.workload, workload);
    // Computes the scores again from the resulting workload alone.
    const auto judged = [&](const SettingCandidate &candidate, std::uint64_t first, std::uint32_t seeds) {
      Score score = score_of(candidate.workload, options, first, seeds);
      score.proven = candidate.score.proven;
      return score;
    };
    EXPECT_FALSE(improves(judged(tuned->present, 1, 2), judged(tuned->best, 1, 2), options.judge)) << i;
    EXPECT_FALSE(improves(judged(tuned->present, 3, 3), judged(tuned->best, 3, 3), options.judge)) << i;
    EXPECT_FALSE(has_errors(validate(tuned->best.workload)));
    changed += tuned->changed() ? 1 : 0;
  }
  EXPECT_GT(changed, 2) << "nothing to tune: the property says nothing";
}

TEST(Tune, TheBestIsThatOfBruteForce) {
  for (std::uint64_t i = 0; i < 15; ++i) {
    const Workload workload = random_workload(100 + i);
    TuneOptions options = quick();
    options.held_out = 0;
    const SettingSpace settings = settings_of(workload, options.freedom);
    std::optional<Score> best;
    for (const Point &point : all_points(settings)) {
      const Workload candidate = settings.apply(point);
      Score score = score_of(candidate, options, 1, 2);
      const auto task_set = analysis::compile(candidate, analysis::platform_of(candidate));
      score.proven = score.missed == 0 && task_set && score_of_bounds(*task_set).proven;
      if (!best || improves(score, *best, options.judge)) best = score;
    }
    const auto tuned = tune(workload, options);
    ASSERT_TRUE(tuned);
    EXPECT_TRUE(tuned->exhaustive);
    EXPECT_EQ(tuned->trials.size(), all_points(settings).size());
    EXPECT_FALSE(improves(*best, tuned->best.score, options.judge)) << i;
    EXPECT_FALSE(improves(tuned->best.score, *best, options.judge)) << i;
  }
}

TEST(Tune, LocalSearchIsNeverBelowItsStartsAndMostlyFindsTheBest) {
  int equal = 0;
  for (std::uint64_t i = 0; i < 15; ++i) {
    const Workload workload = random_workload(200 + i);
    TuneOptions options = quick();
    options.held_out = 0;
    const auto exact = tune(workload, options);
    options.exhaustive = 0;
    const auto local = tune(workload, options);
    EXPECT_FALSE(local->exhaustive);
    EXPECT_FALSE(improves(local->best.score, exact->best.score, options.judge));
    equal += improves(exact->best.score, local->best.score, options.judge) ? 0 : 1;
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
  EXPECT_EQ(one->best.held_out, four->best.held_out);
}

// Returns two DAGs of one rate on one worker. The second one has the shorter deadline.
Workload tie() {
  return make_workload({make_dag("long", {{"t", 20, 8}}), make_dag("short", {{"t", 20, 4, {}, "", 0, 6}})}, 1,
                       PreemptionMode::Os);
}

TEST(Tune, PrioritiesOfEqualRates) {
  TuneOptions options = quick();
  options.freedom.workers = false;
  EXPECT_FALSE(tune(tie(), options)->changed());
  options.freedom.priorities = true;
  const auto tuned = tune(tie(), options);
  ASSERT_TRUE(tuned->changed());
  EXPECT_EQ(tuned->present.score.missed, 40U);
  EXPECT_EQ(tuned->best.score.missed, 0U);
  EXPECT_TRUE(tuned->best.score.proven);
  EXPECT_EQ(tuned->best.workload.policy, PolicyKind::DeadlineMonotonic);
}

TEST(Tune, WorkersWithinTheLimit) {
  const Workload workload = tie();
  TuneOptions options = quick();
  EXPECT_FALSE(tune(workload, options)->changed());
  options.freedom.most_workers = 3;
  const auto tuned = tune(workload, options);
  EXPECT_EQ(tuned->best.workload.platform.workers, 2U);  // not three, which improve nothing further
}

TEST(Tune, AProofComesFirst) {
  Score proven;
  proven.proven = true;
  proven.slack = 0.1;
  Score faster;
  faster.slack = 0.5;
  EXPECT_TRUE(improves(proven, faster, Judge::Bounds));
  EXPECT_FALSE(improves(faster, proven, Judge::Bounds));
  faster.proven = true;
  EXPECT_TRUE(improves(faster, proven, Judge::Bounds));
  EXPECT_FALSE(improves(faster, proven, Judge::Simulation));
  EXPECT_TRUE(is_better(faster, proven, Judge::Simulation));
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
  options.exhaustive = 0;
  options.progress = [&stop](std::uint64_t tried) { stop = tried > 1; };
  const auto tuned = tune(random_workload(1), options);
  ASSERT_TRUE(tuned);
  EXPECT_TRUE(tuned->stopped);
  EXPECT_GT(tuned->trials.size(), 1U);
  EXPECT_GT(tuned->best.held_out.judged, 0U);
}

TEST(Setting, TheRangeOfCaps) {
  const Workload workload = make_workload({make_dag("a", {{"t", 10}}), make_dag("b", {{"t", 10}})}, 4);
  Freedom freedom;
  freedom.workers = false;
  freedom.cap_range = {2, 5};
  const SettingSpace settings = settings_of(workload, freedom);
  EXPECT_THAT(settings.space().values[SettingSpace::kCaps], ::testing::ElementsAre(0, 2, 3, 4, 5));
  EXPECT_THAT(settings.space().values[0], ::testing::ElementsAre(4));
}

// ---- judged by the bounds ----

Tuned by_bounds(const Workload &workload) {
  TuneOptions options;
  options.judge = Judge::Bounds;
  options.freedom.workers = false;
  options.freedom.priorities = true;
  return *tune(workload, options);
}

std::string order_of(const Tuned &tuned) { return tuned.orders[tuned.best.point[SettingSpace::kOrder]]; }

TEST(TuneByBounds, ShortDeadlinesGoFirst) {
  // By rate, b waits for a and responds after 5. By deadline, it responds after 2.
  const Tuned tuned = by_bounds(independent({{3, 10}, {2, 20, 4}}));
  EXPECT_FALSE(tuned.present.score.proven);
  EXPECT_EQ(tuned.present.score.missed, 1U);
  EXPECT_EQ(tuned.present.score.slack, -0.25);
  EXPECT_TRUE(tuned.best.score.proven);
  EXPECT_EQ(order_of(tuned), "deadline_monotonic");
  EXPECT_EQ(tuned.best.score.slack, 0.5);
  EXPECT_EQ(tuned.best.workload.policy, PolicyKind::DeadlineMonotonic);
}

TEST(TuneByBounds, LeavesAloneWhatNothingImproves) {
  const Workload workload = independent({{1, 4}, {1, 8}});
  EXPECT_EQ(by_bounds(workload).best.workload, workload);
  const Workload edf = independent({{3, 10}, {2, 20, 4}}, 1, PolicyKind::Edf);
  const Tuned tuned = by_bounds(edf);
  EXPECT_TRUE(tuned.present.score.proven);
  EXPECT_EQ(tuned.best.workload, edf) << "no static priorities for what edf shows";
}

TEST(TuneByBounds, FewerWithoutABoundComeFirst) {
  Score one;
  one.lost = 1;
  one.slack = -0.5;
  Score two;
  two.lost = 2;
  two.slack = 1;
  EXPECT_TRUE(is_better(one, two, Judge::Bounds));
}

TEST(TuneByBounds, JobsThatCanBeLostHaveNoSlack) {
  Workload workload = independent({{3, 10}, {6, 20, 2}});
  workload.dags[1].tasks[0].budget = 4;
  const Score score = by_bounds(workload).present.score;
  EXPECT_EQ(score.lost, 1U) << "a job that is cut off has no response";
  EXPECT_EQ(score.slack, 0.7);
}

TEST(TuneByBounds, ABoundOfActiveJobsIsolatesADag) {
  // On 3 workers, without preemption, "wide" can fill all workers and block "quick" for 40. With at most 2 active jobs
  // of "wide", "quick" always finds a worker.
  const std::vector<testing::TestTask> wide = {
      {"source", 400, 40}, {"a", 0, 40, {0}}, {"b", 0, 40, {0}}, {"c", 0, 40, {0}}, {"d", 0, 40, {0}}};
  const Workload workload = make_workload({tick_dag("quick", {{"t", 20, 2}}), tick_dag("wide", wide)}, 3);
  const Tuned tuned = by_bounds(workload);
  EXPECT_FALSE(tuned.present.score.proven);
  EXPECT_TRUE(tuned.best.score.proven);
  EXPECT_EQ(tuned.best.workload.dags[0].max_active, 0U);
  EXPECT_EQ(tuned.best.workload.dags[1].max_active, 2U);
  EXPECT_TRUE(tuned.exhaustive);
  EXPECT_EQ(tuned.trials.size(), 4U * tuned.orders.size()) << "none, 1, 2, 3 for wide";
}

TEST(TuneByBounds, NeverWorseAndWhatIsWrittenMeansTheSame) {
  const auto cases = static_cast<int>(testing::how_many(150));
  int better = 0;
  for (int i = 0; i < cases; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 901));
    testing::BoundCaseLimits limits;
    limits.max_workers = 3;
    limits.edges = i % 2 == 0;
    limits.caps = true;
    limits.max_dags = 4;
    limits.preemption = i % 3 == 0 ? sched::Preemption::None : sched::Preemption::Full;
    limits.policies = {PolicyKind::RateMonotonic, PolicyKind::Fixed, PolicyKind::ChainAware, PolicyKind::Edf};
    testing::BoundCase bound_case = testing::random_bound_case(rng, limits);
    bound_case.workload.platform.preemption =
        limits.preemption == sched::Preemption::None ? PreemptionMode::None : PreemptionMode::Os;
    if (has_errors(validate(bound_case.workload))) continue;
    SCOPED_TRACE(describe(bound_case));
    const Tuned tuned = by_bounds(bound_case.workload);
    ASSERT_FALSE(improves(tuned.present.score, tuned.best.score, Judge::Bounds));
    better += tuned.changed() ? 1 : 0;
    // Written to YAML and read again, the workload has the same score. Only order and caps have changed.
    const auto read = parse_workload(to_yaml(tuned.best.workload), "w.yaml");
    ASSERT_TRUE(read) << to_string(read.error());
    Score again = score_of_bounds(analysis::compile(read->workload, analysis::platform_of(read->workload)).value());
    again.changes = tuned.best.score.changes;
    ASSERT_EQ(again, tuned.best.score);
    Workload undone = tuned.best.workload;
    undone.policy = bound_case.workload.policy;
    for (std::size_t d = 0; d < undone.dags.size(); ++d) {
      undone.dags[d].max_active = bound_case.workload.dags[d].max_active;
      for (std::size_t t = 0; t < undone.dags[d].tasks.size(); ++t) {
        undone.dags[d].tasks[t].priority = bound_case.workload.dags[d].tasks[t].priority;
      }
    }
    ASSERT_EQ(undone, bound_case.workload);
  }
  EXPECT_GT(better, 0);
}

}  // namespace
}  // namespace redag::lab
