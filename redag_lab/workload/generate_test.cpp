// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/workload/generate.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/loader/validate.hpp"
#include "redag_lab/workload/generate_utilization.hpp"

namespace redag::lab {
namespace {

GenerateOptions arbitrary_options() {
  GenerateOptions o;
  o.dags = *rc::gen::inRange(1U, 6U);
  o.min_tasks = *rc::gen::inRange(1U, 8U);
  o.max_tasks = o.min_tasks + *rc::gen::inRange(0U, 8U);
  o.workers = *rc::gen::inRange(1U, 9U);
  o.max_task_utilization = *rc::gen::element(0.3, 0.7, 1.0);
  const double most = o.max_task_utilization * o.dags * o.min_tasks;
  o.utilization = most * (*rc::gen::inRange(1, 101)) / 100.0;
  o.periods = *rc::gen::element(PeriodModel::LogUniform, PeriodModel::Harmonic, PeriodModel::Robot);
  o.shape = *rc::gen::element(DagShape::Layered, DagShape::ErdosRenyi, DagShape::ForkJoin, DagShape::Chain,
                              DagShape::Independent);
  o.rates = *rc::gen::element(RateScope::PerDag, RateScope::PerTask);
  o.policy = *rc::gen::element(PolicyKind::RateMonotonic, PolicyKind::Fixed, PolicyKind::Edf);
  o.data_share = *rc::gen::element(0.0, 0.5, 1.0);
  o.bcet_min = *rc::gen::element(0.0, 0.5, 1.0);
  o.deadline_min = *rc::gen::element(0.2, 1.0);
  o.jitter = *rc::gen::element(0.0, 0.1, 1.0);
  o.offsets = *rc::gen::arbitrary<bool>();
  o.max_active_max = *rc::gen::inRange(0U, 4U);
  o.groups = 2;
  o.group_share = 0.3;
  o.queue_share = 0.5;
  return o;
}

RC_GTEST_PROP(Generate, IsValidAndHasItsUtilization, (std::uint64_t seed)) {
  const GenerateOptions options = arbitrary_options();
  const Result<Workload> workload = generate(options, seed);
  RC_ASSERT(workload.has_value());
  RC_ASSERT(!has_errors(validate(*workload)));
  RC_ASSERT(workload->dags.size() == options.dags);
  // Rounding to a nanosecond costs each task at most one nanosecond in the shortest period, 1 ms.
  const double rounding = 1e-6 * static_cast<double>(workload->task_count()) + 1e-9;
  RC_ASSERT(std::abs(workload->utilization() - options.utilization) <= rounding);
  for (const Dag &dag : workload->dags) {
    RC_ASSERT(dag.tasks.size() >= options.min_tasks && dag.tasks.size() <= options.max_tasks);
    for (const Task &task : dag.tasks) {
      const double share = static_cast<double>(task.wcet) / static_cast<double>(task.period);
      RC_ASSERT(share <= options.max_task_utilization + 1e-6);
    }
  }
}

RC_GTEST_PROP(Generate, SameSeedSameWorkload, (std::uint64_t seed)) {
  const GenerateOptions options = arbitrary_options();
  RC_ASSERT(generate(options, seed).value() == generate(options, seed).value());
}

TEST(Generate, OtherSeedOtherWorkload) { EXPECT_NE(generate({}, 1).value().dags, generate({}, 2).value().dags); }

TEST(Generate, AnOptionChangesOnlyWhatItIsAbout) {
  GenerateOptions options;
  Workload before = generate(options, 3).value();
  options.jitter = 0.5;
  Workload after = generate(options, 3).value();
  EXPECT_NE(before, after);
  for (Dag &dag : after.dags) {
    for (Task &task : dag.tasks) task.jitter = 0;
  }
  EXPECT_EQ(before, after);
}

std::map<Duration, int> period_counts(PeriodModel model) {
  GenerateOptions options;
  options.dags = 2000;
  options.min_tasks = options.max_tasks = 1;
  options.periods = model;
  std::map<Duration, int> counts;
  const Workload workload = generate(options, 5).value();
  for (const Dag &dag : workload.dags) ++counts[dag.tasks[0].period];
  return counts;
}

TEST(Generate, PeriodsOfRobotsHaveTheirShares) {
  auto counts = period_counts(PeriodModel::Robot);
  EXPECT_EQ(counts.size(), 10U);
  EXPECT_NEAR(counts[20 * kMillisecond], 2000.0 * 20 / 100, 75);
  EXPECT_NEAR(counts[kSecond], 2000.0 * 5 / 100, 40);
}

TEST(Generate, HarmonicPeriodsDivideEachOther) {
  const auto counts = period_counts(PeriodModel::Harmonic);  // 5 ms to 500 ms
  EXPECT_EQ(counts.size(), 7U);
  EXPECT_EQ(counts.begin()->first, 5 * kMillisecond);
  EXPECT_EQ(counts.rbegin()->first, 320 * kMillisecond);
}

TEST(Generate, LogUniformPeriodsAreEvenOverTheMagnitudes) {
  int below_50 = 0;
  for (const auto &[period, count] : period_counts(PeriodModel::LogUniform)) {
    EXPECT_EQ(period % kMillisecond, 0);
    EXPECT_GE(period, 5 * kMillisecond);
    EXPECT_LE(period, 500 * kMillisecond);
    if (period < 50 * kMillisecond) below_50 += count;
  }
  EXPECT_NEAR(below_50, 1000, 100);  // 5 to 50 is half of 5 to 500
}

TEST(Generate, ShapesAreWhatTheirNamesSay) {
  const auto dag_of = [](DagShape shape) {
    GenerateOptions options;
    options.dags = 1;
    options.min_tasks = options.max_tasks = 6;
    options.shape = shape;
    options.edge_probability = 1.0;
    return generate(options, 1).value().dags.front();
  };
  const auto edges = [](const Dag &dag) {
    return std::accumulate(dag.tasks.begin(), dag.tasks.end(), std::size_t{0},
                           [](std::size_t n, const Task &task) { return n + task.predecessors.size(); });
  };
  EXPECT_EQ(edges(dag_of(DagShape::Independent)), 0U);
  EXPECT_EQ(edges(dag_of(DagShape::Chain)), 5U);
  EXPECT_EQ(edges(dag_of(DagShape::ErdosRenyi)), 15U);
  const Dag fork_join = dag_of(DagShape::ForkJoin);
  EXPECT_EQ(edges(fork_join), 8U);
  EXPECT_EQ(fork_join.tasks.back().predecessors.size(), 4U);
  const Dag layered = dag_of(DagShape::Layered);
  EXPECT_GT(edges(layered), 0U);
}

TEST(Generate, RefusesOptionsWithAllReasons) {
  GenerateOptions options;
  options.dags = 0;
  options.jitter = 2;
  options.period_min = 0;
  const auto refused = generate(options, 1);
  ASSERT_FALSE(refused);
  const std::string found = to_string(refused.error());
  EXPECT_NE(found.find("dags must be at least 1"), std::string::npos) << found;
  EXPECT_NE(found.find("jitter must be from 0 to 1, not 2"), std::string::npos) << found;
  EXPECT_NE(found.find("period_min is below period_granularity"), std::string::npos) << found;
}

template <class Enum, std::size_t N>
std::set<std::string> names_of(const std::array<Enum, N> &values) {
  std::set<std::string> names;
  for (const Enum value : values) names.insert(to_string(value));
  return names;
}

TEST(GenerateNames, AreThoseOfTheCommandLine) {
  EXPECT_EQ(names_of(kPeriodModels), (std::set<std::string>{"log_uniform", "harmonic", "robot"}));
  EXPECT_EQ(names_of(kDagShapes),
            (std::set<std::string>{"layered", "erdos_renyi", "fork_join", "chain", "independent"}));
}

RC_GTEST_PROP(Drs, KeepsSumAndBounds, (std::uint64_t seed)) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 60);
  std::vector<double> upper(count);
  for (double &u : upper) u = *rc::gen::inRange(1, 101) / 100.0;
  const double most = std::accumulate(upper.begin(), upper.end(), 0.0);
  const double total = most * *rc::gen::inRange(1, 101) / 100.0;
  Rng rng(seed);
  const auto drawn = drs(total, upper, rng);
  RC_ASSERT(drawn.has_value());
  RC_ASSERT(std::abs(std::accumulate(drawn->begin(), drawn->end(), 0.0) - total) <= 1e-7 * total);
  for (std::size_t i = 0; i < count; ++i) RC_ASSERT((*drawn)[i] >= 0 && (*drawn)[i] <= upper[i]);
}

/// Draws uniformly from {u : sum u = total, 0 <= u_i <= bound}: UUniFast (E. Bini, G. Buttazzo, RTS 30, 2005) until a
/// vector keeps the bound (R. Davis, A. Burns, RTSS 2009).
std::vector<double> uunifast_discard(std::size_t count, double total, double bound, Rng &rng) {
  for (;;) {
    std::vector<double> values(count);
    double rest = total;
    for (std::size_t i = 0; i + 1 < count; ++i) {
      const double next = rest * std::pow(rng.uniform01(), 1.0 / static_cast<double>(count - i - 1));
      values[i] = rest - next;
      rest = next;
    }
    values.back() = rest;
    if (std::all_of(values.begin(), values.end(), [bound](double value) { return value <= bound; })) return values;
  }
}

/// Returns the largest difference between the empirical distributions of two samples (Kolmogorov-Smirnov).
double largest_difference(std::vector<double> a, std::vector<double> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  double largest = 0;
  std::size_t j = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    while (j < b.size() && b[j] <= a[i]) ++j;
    const double below = static_cast<double>(j) / static_cast<double>(b.size());
    largest = std::max(largest, std::abs(static_cast<double>(i + 1) / static_cast<double>(a.size()) - below));
  }
  return largest;
}

// Both methods are uniform over the same set, and every coordinate has the same distribution. The totals cover both
// ways of drs(): it draws 0.9 of 4 bounds of 0.4 by the slacks and 0.5 of 4 directly.
class DrsAgainstDiscard : public testing::TestWithParam<double> {};

TEST_P(DrsAgainstDiscard, HasTheSameDistribution) {
  constexpr std::size_t kDraws = 20'000;
  constexpr double kBound = 0.4;
  const double total = GetParam();
  Rng rng(17);
  std::vector<double> by_drs;
  std::vector<double> by_discarding;
  for (std::size_t i = 0; i < kDraws; ++i) {
    by_drs.push_back(drs(total, std::vector<double>(4, kBound), rng).value()[0]);
    by_discarding.push_back(uunifast_discard(4, total, kBound, rng)[0]);
  }
  // At the level 0.001, two samples of n differ by 1.95 * sqrt(2 / n) = 0.0195. The seed is fixed.
  EXPECT_LT(largest_difference(by_drs, by_discarding), 0.0195);
}

INSTANTIATE_TEST_SUITE_P(Totals, DrsAgainstDiscard, testing::Values(0.5, 0.7, 0.9, 1.2));

TEST(Drs, ReachesTheBoundsAndNoFurther) {
  Rng rng(1);
  EXPECT_EQ(drs(1.0, {0.5, 0.5}, rng), (std::vector<double>{0.5, 0.5}));
  EXPECT_EQ(drs(1.1, {0.5, 0.5}, rng), std::nullopt);
}

TEST(Drs, ManyTasks) {
  Rng rng(2);
  const auto drawn = drs(16, std::vector<double>(1000, 1.0), rng);
  ASSERT_TRUE(drawn);
  EXPECT_NEAR(std::accumulate(drawn->begin(), drawn->end(), 0.0), 16, 1e-6);
}

}  // namespace
}  // namespace redag::lab
