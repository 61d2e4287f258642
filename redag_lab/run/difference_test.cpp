// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/difference.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/builders.hpp"

namespace redag::lab {
namespace {

using ::testing::ElementsAre;
using testing::make_dag;
using testing::make_workload;

// A fast task, and a slow one that delays it unless it is preempted. Execution times vary with the seed.
Workload contention(const char *second = "b") {
  Workload workload =
      make_workload({make_dag("a", {{"fast", 10, 2}}), make_dag(second, {{"slow", 100, 24}, {"after", 0, 6, {0}}})}, 1);
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      task.bcet = task.wcet / 2;
      task.execution.kind = ExecutionTime::Kind::Uniform;
    }
  }
  return workload;
}

trace::Trace run_of(const Workload &workload, sched::Preemption mode, std::uint64_t seed, Duration length,
                    Duration warm_up = 0) {
  trace::Trace trace;
  trace.info.workload = workload;
  trace.info.config = sched::config_of(workload);
  trace.info.config.preemption = mode;
  trace.info.end = length;
  trace.info.warm_up = warm_up;
  const auto scheduler = executors::make_scheduler("redag", workload, trace.info.config);
  sim::Options options;
  options.seed = seed;
  options.horizon = length;
  sim::simulate(workload, *scheduler, workload.platform.workers, options, [&](std::span<const JobEvent> events) {
    trace.events.insert(trace.events.end(), events.begin(), events.end());
    return true;
  });
  return trace;
}

DifferenceSide side(sched::Preemption mode, std::uint64_t seed, int runs = 2, const char *second = "b") {
  DifferenceSide made;
  for (int i = 0; i < runs; ++i) {
    made.add(run_of(contention(second), mode, seed + static_cast<std::uint64_t>(i), 20 * kSecond));
  }
  return made;
}

constexpr double kTolerance = 0.05;

TEST(Difference, RowsAreAllJobsThenDagsWithTheirTasks) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 1);
  std::vector<std::string> names;
  for (const DifferenceSide::Row &row : a.rows()) names.push_back(row.dag + "/" + row.task);
  EXPECT_THAT(names, ElementsAre("/", "a/", "a/fast", "b/", "b/slow", "b/after"));
  EXPECT_EQ(a.rows()[0].jobs.released, a.rows()[1].jobs.released + a.rows()[3].jobs.released);
  EXPECT_EQ(a.rows()[1].jobs.released, 2000U);
  EXPECT_EQ(a.rows()[2].runs.at(0).size(), 10U);  // of 2 s
  std::uint64_t in_stretches = 0;
  for (const DifferenceSide::Jobs &stretch : a.rows()[2].runs[0]) in_stretches += stretch.released;
  EXPECT_EQ(in_stretches, 2000U);
}

TEST(Difference, CountsAsTheSummaryDoes) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 1);
  std::uint64_t missed = 0;
  for (const DifferenceSide::Jobs &stretch : a.rows()[2].runs[0]) missed += stretch.missed;
  EXPECT_EQ(missed, a.rows()[2].jobs.missed());
  EXPECT_GT(missed, 100U);  // without preemption, 24 ms delay a task with a period of 10 ms
}

TEST(Difference, ADagAnswersEndToEndAndAllJobsTogetherDoNot) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 1);
  const auto responses = [](const DifferenceSide::Row &row) {
    std::size_t count = 0;
    for (const DifferenceSide::Jobs &stretch : row.runs[0]) count += stretch.responses.size();
    return count;
  };
  EXPECT_EQ(responses(a.rows()[0]), 0U);
  EXPECT_FALSE(a.rows()[0].has_responses());
  EXPECT_EQ(responses(a.rows()[3]), responses(a.rows()[5])) << "those of its sink alone";
  const auto longest = [](const DifferenceSide::Row &row) {
    Duration most = 0;
    for (const DifferenceSide::Jobs &stretch : row.runs[0]) {
      for (const Duration response : stretch.responses) most = std::max(most, response);
    }
    return most;
  };
  EXPECT_GT(longest(a.rows()[3]), longest(a.rows()[4]) + 3 * kMillisecond) << "`after` takes that long after `slow`";
}

TEST(Difference, ADagWithSeveralSinksHasNoResponse) {
  Workload workload = make_workload({make_dag("fork", {{"src", 10, 1}, {"x", 0, 1, {0}}, {"y", 0, 1, {0}}})}, 1);
  DifferenceSide a;
  a.add(run_of(workload, sched::Preemption::None, 1, kSecond));
  EXPECT_FALSE(a.rows()[1].has_responses());
  EXPECT_TRUE(a.rows()[3].has_responses());
}

TEST(Difference, WarmUpIsNotCounted) {
  DifferenceSide a;
  a.add(run_of(contention(), sched::Preemption::None, 1, 20 * kSecond, 5 * kSecond));
  EXPECT_EQ(a.rows()[1].jobs.released, 1500U);
}

TEST(Difference, PreemptionIsBetterForTheFastTaskAlone) {
  const DifferenceSide a = side(sched::Preemption::None, 1);
  const DifferenceSide b = side(sched::Preemption::Full, 1);
  const Difference there = compare_sides(a, b, kTolerance);
  ASSERT_EQ(there.rows.size(), 6U);
  EXPECT_EQ(there.rows[2].miss_ratio.verdict, Verdict::Better);
  EXPECT_EQ(there.rows[2].responses[1].verdict, Verdict::Better);
  EXPECT_EQ(there.rows[4].responses[0].verdict, Verdict::Worse);
  EXPECT_TRUE(there.is_any(Verdict::Worse));
  const Difference back = compare_sides(b, a, kTolerance);
  EXPECT_EQ(back.rows[2].miss_ratio.verdict, Verdict::Worse);
  EXPECT_EQ(back.rows[4].responses[0].verdict, Verdict::Better);
}

TEST(Difference, OtherSeedsOfTheSameAreTheSame) {
  int differing = 0;
  for (std::uint64_t i = 0; i < 8; ++i) {
    const DifferenceSide a = side(sched::Preemption::None, 100 + 10 * i);
    const DifferenceSide b = side(sched::Preemption::None, 105 + 10 * i);
    const Difference difference = compare_sides(a, b, kTolerance);
    differing += difference.is_any(Verdict::Better) || difference.is_any(Verdict::Worse) ? 1 : 0;
  }
  EXPECT_LE(differing, 2);
}

TEST(Difference, RowsOfOneSideAreLeftOut) {
  const Difference difference =
      compare_sides(side(sched::Preemption::None, 1), side(sched::Preemption::None, 1, 2, "c"), kTolerance);
  EXPECT_EQ(difference.rows.size(), 3U);
}

TEST(Difference, ShortRunsAreNotTested) {
  DifferenceSide a;
  a.add(run_of(contention(), sched::Preemption::None, 1, kSecond));
  DifferenceSide b;
  b.add(run_of(contention(), sched::Preemption::Full, 1, kSecond));
  const Difference difference = compare_sides(a, b, kTolerance);  // 5 stretches of 200 ms
  EXPECT_EQ(difference.rows[2].miss_ratio.verdict, Verdict::NotTested);
}

TEST(Difference, OfManyRunsWholeOnesAreCompared) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 5);
  const DifferenceSide b = side(sched::Preemption::Full, 11, 5);
  const Difference difference = compare_sides(a, b, kTolerance);
  EXPECT_TRUE(difference.of_runs);
  EXPECT_EQ(difference.rows[2].miss_ratio.verdict, Verdict::Better);
  EXPECT_FALSE(compare_sides(a, side(sched::Preemption::Full, 11, 4), kTolerance).of_runs);
}

TEST(RankSum, KnownValues) {
  // U = 0 of 5 and 5: the exact p is 1 / 252 = 0.0040, and the approximation with continuity says 0.0061.
  EXPECT_NEAR(p_larger(std::vector<double>{1, 2, 3, 4, 5}, std::vector<double>{6, 7, 8, 9, 10}), 0.0061, 0.0001);
  EXPECT_GT(p_larger(std::vector<double>{6, 7, 8, 9, 10}, std::vector<double>{1, 2, 3, 4, 5}), 0.99);
  EXPECT_NEAR(p_larger(std::vector<double>{1, 3}, std::vector<double>{2, 2}), 0.64, 0.05);
  EXPECT_EQ(p_larger(std::vector<double>{3, 3}, std::vector<double>{3, 3, 3}), 1) << "all are equal";
}

// Misses in bursts of 20 jobs on average, in stretches of 300 jobs: equal sides differ about as often as the test says,
// and one burst is one event.
TEST(RankSum, BurstsOfMisses) {
  const auto shares = [](std::uint64_t seed, double begin) {
    Rng rng(seed);
    std::vector<double> stretches(10);
    bool burst = false;
    for (double &share : stretches) {
      for (int job = 0; job < 300; ++job) {
        if (rng.uniform01() < (burst ? 0.05 : begin)) burst = !burst;
        share += burst ? 1.0 / 300 : 0;
      }
    }
    return stretches;
  };
  int equal = 0;
  int fewer = 0;
  constexpr int kTrials = 400;
  for (std::uint64_t i = 0; i < kTrials; ++i) {
    const std::vector<double> a = shares(mix(2 * i), 0.005);
    equal += p_larger(a, shares(mix(2 * i + 1), 0.005)) <= 0.05 ? 1 : 0;
    fewer += p_larger(shares(mix(2 * i + 1), 0.0005), a) <= 0.05 ? 1 : 0;
  }
  EXPECT_LE(equal, kTrials * 8 / 100);
  EXPECT_GE(equal, kTrials / 100) << "a test that never speaks";
  EXPECT_GE(fewer, kTrials * 8 / 10);
  std::vector<double> one_burst(10);
  one_burst[7] = 0.6;
  EXPECT_GT(p_larger(std::vector<double>(10), one_burst), 0.1);
}

TEST(DiscoveryThreshold, OfBenjaminiAndHochberg) {
  EXPECT_EQ(discovery_threshold({}), 0);
  EXPECT_EQ(discovery_threshold({0.2, 0.9}), 0);
  EXPECT_DOUBLE_EQ(discovery_threshold({0.9, 0.01, 0.03, 0.02}), 0.03);
}

}  // namespace
}  // namespace redag::lab
