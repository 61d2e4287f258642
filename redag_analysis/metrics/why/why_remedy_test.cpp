// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_remedy.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "redag_analysis/metrics/why/why_text.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/repository.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::metrics {
namespace {

using ::testing::HasSubstr;
using testing::make_dag;
using testing::make_workload;
using ::testing::Not;

std::vector<Cause> causes() {
  std::vector<Cause> all;
  for (int c = 0; c <= static_cast<int>(kLastCause); ++c) all.push_back(static_cast<Cause>(c));
  return all;
}

TEST(WhyRemedy, EachCauseHasOne) {
  for (const Cause cause : causes()) EXPECT_EQ(remedy(cause).empty(), cause == Cause::Removed) << to_string(cause);
}

// Compares the table of docs/why.md with the code.
TEST(WhyRemedy, ThePageListsThemAll) {
  std::string expected;
  for (const Cause cause : causes()) {
    if (remedy(cause).empty()) continue;
    expected += fmt::format("| `{}` | {} |\n", describe(cause, "X"), remedy(cause));
  }
  std::ifstream page(testing::repository() / "docs" / "why.md");
  std::string rows;
  bool is_here = false;
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("## ")) is_here = line == "## What to change";
    if (is_here && line.starts_with("| `")) rows += line + "\n";
  }
  EXPECT_EQ(rows, expected);
}

// A run without priorities: the remedy is another executor, and no advice that only ours can follow.
TEST(WhyRemedy, OfAnotherExecutorIsOurs) {
  const Workload workload = make_workload({make_dag("fast", {{"a", 10, 3}}), make_dag("slow", {{"b", 100, 30}})});
  const trace::Trace trace = testing::simulated(testing::run_info(workload, "ste"), 200 * kMillisecond);
  const Investigation investigation = Investigation::of(trace).value();
  CulpritCount count;
  const std::vector<Explanation> explained = investigation.explain(investigation.misses()).value();
  for (const Explanation &one : explained) count.add(one);
  const std::optional<MainCause> main = main_cause_of(count.sorted());
  ASSERT_TRUE(main.has_value());
  EXPECT_EQ(describe(*main, workload), "queued behind slow.b");
  EXPECT_THAT(remedy(*main, trace.info), HasSubstr("slow.b delayed fast.a by up to 10ms: ste has no priorities"));
  EXPECT_THAT(remedy(*main, trace.info), Not(HasSubstr("preemption")));
}

// The device of a job may serve another cluster, whose jobs nobody names.
TEST(WhyRemedy, OfADeviceThatServesAnotherCluster) {
  const Workload workload = make_workload({make_dag("d", {{"a", 10, 3}})});
  Culprit culprit;
  culprit.cause = Cause::DeviceQueue;
  culprit.delayed = TaskId(0);
  EXPECT_THAT(remedy(culprit, testing::run_info(workload, "redag")),
              HasSubstr("does for another cluster, or add a slot"));
}

Culprit culprit(Cause cause, std::uint32_t task, std::size_t main, Duration longest) {
  Culprit one;
  one.cause = cause;
  one.task = TaskId(task);
  one.jobs = one.main = main;
  one.time = one.longest = longest;
  one.delayed = TaskId(0);
  return one;
}

TEST(WhyRemedy, TheMainCauseIsAKindOfCauseWithItsCulprits) {
  Workload workload =
      make_workload({make_dag("d", {{"a", 10, 1}, {"b", 20, 1}, {"c", 30, 1}, {"e", 40, 1}, {"f", 50, 1}})});
  workload.dags[0].tasks[1].region = 500 * kMicrosecond;
  trace::RunInfo run = testing::run_info(workload);
  run.preemption = "none";
  const std::vector<Culprit> culprits = {
      culprit(Cause::Queued, 4, 5, 9 * kMillisecond),  culprit(Cause::Blocked, 1, 3, 2 * kMillisecond),
      culprit(Cause::Blocked, 2, 2, 7 * kMillisecond), culprit(Cause::Blocked, 3, 1, 1 * kMillisecond),
      culprit(Cause::Blocked, 4, 1, 1 * kMillisecond), culprit(Cause::Execution, 0, 0, 20 * kMillisecond)};
  const std::optional<MainCause> main = main_cause_of(culprits);
  ASSERT_TRUE(main.has_value());
  EXPECT_EQ(main->jobs, 7);
  EXPECT_EQ(describe(*main, workload), "blocked by d.b (3), d.c (2), d.e (1) and 1 other, less urgent");
  EXPECT_EQ(
      remedy(*main, run),
      "d.c delayed d.a by up to 7ms: let these callbacks give way (preemption: os, or cooperative with preemption "
      "points), shorten them, or add a worker");
  EXPECT_EQ(remedy(culprits[1], run),
            "d.b delayed d.a by up to 2ms: let d.b give way (preemption: os, or cooperative, with the points that it "
            "has every 500us), shorten it, or add a worker");
  run.preemption = "full";
  EXPECT_EQ(remedy(culprits[1], run), "d.b delayed d.a by up to 2ms: shorten d.b, or add a worker");
  EXPECT_FALSE(main_cause_of(std::vector{culprits[5]}).has_value());
}

Explanation delayed_by(std::uint32_t task, Duration time) {
  Explanation one;
  one.job.task = TaskId(0);
  one.job.outcome = JobOutcome::Finished;
  one.end = time;
  one.parts.push_back({.cause = Cause::Queued, .job = {TaskId(0), 0}, .by = {TaskId(task), 0}, .length = time});
  return one;
}

TEST(WhyRemedy, ACulpritsLongestDelayIsThatOfOneJob) {
  CulpritCount count;
  for (const Duration time : {2, 7, 3}) count.add(delayed_by(1, time));
  const std::vector<Culprit> sorted = count.sorted();
  ASSERT_EQ(sorted.size(), 1U);
  EXPECT_EQ(sorted[0].time, 12);
  EXPECT_EQ(sorted[0].longest, 7);
  EXPECT_EQ(sorted[0].delayed, TaskId(0));
}

// Why a job was lost says more than where its time went.
TEST(WhyRemedy, OfALossIsThatOfItsReason) {
  Workload workload = make_workload({make_dag("d", {{"a", 10, 5}})});
  workload.dags[0].tasks[0].budget = 2 * kMillisecond;
  const trace::Trace trace = testing::simulated(testing::run_info(workload), 50 * kMillisecond);
  const Investigation investigation = Investigation::of(trace).value();
  ASSERT_FALSE(investigation.misses().empty());
  const std::vector<Explanation> explained = investigation.explain(investigation.misses()).value();
  for (const Explanation &one : explained) {
    const std::vector<Culprit> culprits = culprits_of(one);
    EXPECT_EQ(describe(culprits.front(), workload), "d.a: its budget was used up");
    EXPECT_EQ(remedy(culprits.front(), trace.info), "raise the budget of d.a (now 2ms), or shorten it");
    EXPECT_EQ(culprits.front().main, 1);
    EXPECT_EQ(culprits.at(1).main, 0);
  }
}

}  // namespace
}  // namespace redag::metrics
