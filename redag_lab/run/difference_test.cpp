// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/difference.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

BootstrapOptions quick() {
  BootstrapOptions options;
  options.replicates = 500;
  return options;
}

TEST(Difference, RowsAreAllJobsThenDagsWithTheirTasks) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 1);
  std::vector<std::string> names;
  for (const DifferenceSide::Row &row : a.rows()) names.push_back(row.dag + "/" + row.task);
  EXPECT_THAT(names, ElementsAre("/", "a/", "a/fast", "b/", "b/slow", "b/after"));
  EXPECT_EQ(a.rows()[0].jobs.released, a.rows()[1].jobs.released + a.rows()[3].jobs.released);
  EXPECT_EQ(a.rows()[1].jobs.released, 2000U);
  EXPECT_EQ(a.rows()[2].runs.at(0).size(), 28U);  // of 700 ms
  std::uint64_t in_blocks = 0;
  for (const Block &block : a.rows()[2].runs[0]) in_blocks += block.released;
  EXPECT_EQ(in_blocks, 2000U);
}

TEST(Difference, CountsAsTheSummaryDoes) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 1);
  std::uint64_t missed = 0;
  for (const Block &block : a.rows()[2].runs[0]) missed += block.missed;
  EXPECT_EQ(missed, a.rows()[2].jobs.missed());
  EXPECT_GT(missed, 100U);  // without preemption, 24 ms delay a task with a period of 10 ms
}

TEST(Difference, ADagAnswersEndToEndAndAllJobsTogetherDoNot) {
  const DifferenceSide a = side(sched::Preemption::None, 1, 1);
  const auto responses = [](const DifferenceSide::Row &row) {
    std::size_t count = 0;
    for (const Block &block : row.runs[0]) count += block.responses.size();
    return count;
  };
  EXPECT_EQ(responses(a.rows()[0]), 0U);
  EXPECT_FALSE(a.rows()[0].has_responses());
  EXPECT_EQ(responses(a.rows()[3]), responses(a.rows()[5])) << "those of its sink alone";
  EXPECT_GT(a.rows()[3].max, a.rows()[4].max + 3 * kMillisecond) << "`after` takes that long after `slow`";
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
  const Difference there = compare_sides(a, b, quick());
  ASSERT_EQ(there.rows.size(), 6U);
  EXPECT_EQ(there.rows[2].miss, Verdict::Better);
  EXPECT_EQ(there.rows[2].p95, Verdict::Better);
  EXPECT_EQ(there.rows[4].p95, Verdict::Worse);
  EXPECT_TRUE(there.is_any(Verdict::Worse));
  const Difference back = compare_sides(b, a, quick());
  EXPECT_EQ(back.rows[2].miss, Verdict::Worse);
  EXPECT_EQ(back.rows[4].p95, Verdict::Better);
}

TEST(Difference, OtherSeedsOfTheSameAreTheSame) {
  int differing = 0;
  for (std::uint64_t i = 0; i < 8; ++i) {
    const DifferenceSide a = side(sched::Preemption::None, 100 + 10 * i);
    const DifferenceSide b = side(sched::Preemption::None, 105 + 10 * i);
    const Difference difference = compare_sides(a, b, quick());
    differing += difference.is_any(Verdict::Better) || difference.is_any(Verdict::Worse) ? 1 : 0;
  }
  EXPECT_LE(differing, 2);
}

TEST(Difference, RowsOfOneSideAreNamed) {
  const Difference difference =
      compare_sides(side(sched::Preemption::None, 1), side(sched::Preemption::None, 1, 2, "c"), quick());
  EXPECT_THAT(difference.missing, ElementsAre("b", "b.slow", "b.after", "c", "c.slow", "c.after"));
  EXPECT_EQ(difference.rows.size(), 3U);
}

TEST(Difference, ShortRunsAreNotTested) {
  DifferenceSide a;
  a.add(run_of(contention(), sched::Preemption::None, 1, kSecond));
  DifferenceSide b;
  b.add(run_of(contention(), sched::Preemption::Full, 1, kSecond));
  const Difference difference = compare_sides(a, b, quick());  // 5 blocks of 200 ms
  EXPECT_EQ(difference.tests, 0U);
  EXPECT_EQ(difference.rows[2].miss, Verdict::NotTested);
}

}  // namespace
}  // namespace redag::lab
