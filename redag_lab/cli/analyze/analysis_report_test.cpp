// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_report.hpp"

#include <gtest/gtest.h>

#include "redag_lab/cli/analyze/analysis_explanation.hpp"
#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

// Returns a (T 10, C 3) and b (T 20, C 7) on one worker, in milliseconds. With preemption the responses are 3 and
// 7 + 3 = 10, when the second job of a arrives.
Workload two_tasks(PreemptionMode mode) {
  return testing::make_workload({testing::make_dag("fast", {{"a", 10, 3}}), testing::make_dag("slow", {{"b", 20, 7}})},
                                1, mode);
}

lab::Analysed look_at(const Workload &workload) {
  Result<lab::Analysed> analysed = lab::analyse(workload, analysis::platform_of(workload));
  EXPECT_TRUE(analysed) << to_string(analysed.error());
  return *std::move(analysed);
}

lab::Row row_of(const lab::Analysed &analysed, const std::string &name) {
  Result<lab::Row> row = find_row(analysed, name);
  EXPECT_TRUE(row) << to_string(row.error());
  return *std::move(row);
}

TEST(AnalysisReport, KnownResponsesOnOneWorker) {
  const lab::Analysed analysed = look_at(two_tasks(PreemptionMode::Os));
  const std::vector<lab::Row> rows = lab::task_rows(analysed);
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0].name, "fast.a");
  EXPECT_EQ(rows[0].tightest.response, 3 * kMillisecond);
  EXPECT_EQ(rows[0].slack, 7 * kMillisecond);
  EXPECT_EQ(rows[0].standing, lab::Standing::Ok);
  EXPECT_EQ(rows[0].says->name, "rta_preemptive");
  EXPECT_EQ(rows[1].tightest.response, 10 * kMillisecond);
  EXPECT_EQ(verdict_in_words(analysed).find("schedulable: every deadline is met, by "), 0U);
}

TEST(AnalysisReport, AnotherExecutorIsItsOwnHeadlineAndMethods) {
  Workload workload = two_tasks(PreemptionMode::Os);
  workload.dags[0].tasks[0].period = workload.dags[0].tasks[0].deadline = 20 * kMillisecond;
  const Result<lab::Analysed> analysed = lab::analyse(workload, analysis::platform_of(workload), "ste");
  ASSERT_TRUE(analysed);
  EXPECT_EQ(lab::task_rows(*analysed)[0].tightest.response, 10 * kMillisecond) << "3 after 7";
  const std::string text = describe(*analysed, StreamTraits{}, false);
  EXPECT_NE(text.find("SingleThreadedExecutor"), std::string::npos) << text;
  EXPECT_NE(text.find("wait_set and dag_any"), std::string::npos) << text;
  EXPECT_EQ(text.find("rta_nonpreemptive"), std::string::npos) << text;
  EXPECT_EQ(to_json(*analysed)["executor"], "ste");
  EXPECT_EQ(to_json(*analysed)["preemption"], "none");
  EXPECT_FALSE(lab::analyse(workload, analysis::platform_of(workload), "SingleThreadedExecutor"));
}

// Without preemption and with fixed offsets, b never arrives while a runs, nor a while b runs.
TEST(AnalysisReport, ATightDeadlineIsNamedNotCalledAMiss) {
  Workload workload = two_tasks(PreemptionMode::Os);
  workload.dags[1].tasks[0].deadline = 9 * kMillisecond;
  const lab::Analysed analysed = look_at(workload);
  const lab::Row row = row_of(analysed, "slow.b");
  EXPECT_EQ(row.standing, lab::Standing::MayMiss);
  EXPECT_EQ(row.slack, -kMillisecond);
  const std::string words = verdict_in_words(analysed);
  EXPECT_EQ(words.find("not shown schedulable: 1 task with a bound above the deadline;"), 0U) << words;
  const std::string text = describe(analysed, StreamTraits{}, false);
  EXPECT_NE(text.find("slow.b       9ms   10ms   -1ms  MAY MISS"), std::string::npos) << text;
  EXPECT_NE(explain(analysed, row, StreamTraits{}).find("the bound exceeds the deadline by 1ms"), std::string::npos);
}

TEST(AnalysisReport, DeadlinesOfDagsCount) {
  Workload workload = two_tasks(PreemptionMode::Os);
  workload.dags[1].deadline = 8 * kMillisecond;
  const lab::Analysed analysed = look_at(workload);
  EXPECT_EQ(lab::dag_rows(analysed)[0].standing, lab::Standing::NoDeadline);
  EXPECT_EQ(lab::dag_rows(analysed)[1].standing, lab::Standing::MayMiss);
  EXPECT_EQ(verdict_in_words(analysed).find("not shown schedulable: 1 DAG with a bound above the end-to-end"), 0U);
}

TEST(AnalysisReport, ATestWithoutNumbersStillAnswers) {
  Workload workload = two_tasks(PreemptionMode::Auto);
  workload.policy = PolicyKind::Edf;
  workload.dags[0].tasks[0].wcet = 5 * kMillisecond;  // a fully used worker: too much for the bounds
  workload.dags[1].tasks[0].wcet = 10 * kMillisecond;
  const lab::Analysed analysed = look_at(workload);
  const lab::Row row = row_of(analysed, "fast.a");
  EXPECT_EQ(row.standing, lab::Standing::Ok);
  EXPECT_FALSE(row.slack);
  EXPECT_EQ(row.says->name, "edf_demand");
  EXPECT_NE(mode_reason(analysed).find("threads run edf as cooperative"), std::string::npos);
  EXPECT_NE(explain(analysed, row, StreamTraits{}).find("gives no response times"), std::string::npos);
}

TEST(AnalysisReport, ThePapersEquationsAreShownAndNotTrusted) {
  Workload workload = two_tasks(PreemptionMode::Os);
  workload.dags[1].tasks[0].jitter = kMillisecond;
  const Json document = to_json(look_at(workload));
  bool is_shown = false;
  for (const Json &method : document["methods"]) {
    if (method["name"] != "paper_rta") continue;
    is_shown = true;
    EXPECT_EQ(method["applies"], true);
    EXPECT_EQ(method["sound"], false);
    EXPECT_NE(method["unsound_because"], "");
  }
  EXPECT_TRUE(is_shown);
  for (const Json &task : document["tasks"]) EXPECT_NE(task["method"], "paper_rta");
}

TEST(AnalysisReport, WhatNoMethodTakesIsSaidOnce) {
  Workload workload = two_tasks(PreemptionMode::Os);
  workload.dags[0].tasks[0].budget = kMillisecond;
  const lab::Analysed analysed = look_at(workload);
  const std::string text = describe(analysed, StreamTraits{}, false);
  EXPECT_NE(text.find("no method applies to all tasks: "), std::string::npos) << text;
  EXPECT_EQ(row_of(analysed, "fast").standing, lab::Standing::NoBound);
  EXPECT_NE(row_of(analysed, "fast").reason.find("budget"), std::string::npos);
}

TEST(AnalysisReport, ManyTasksAreCutToThoseWithTheLeastSlack) {
  Workload workload = two_tasks(PreemptionMode::Os);
  for (int i = 0; i < 60; ++i) {
    workload.dags.push_back(testing::tick_dag("d" + std::to_string(i), {{"t", kSecond, kMicrosecond}}));
  }
  const lab::Analysed analysed = look_at(workload);
  const std::string few = describe(analysed, StreamTraits{}, false);
  EXPECT_NE(few.find("(the 50 of 62 tasks with the least slack"), std::string::npos);
  EXPECT_NE(few.find("fast.a "), std::string::npos);
  EXPECT_NE(describe(analysed, StreamTraits{}, true).find("d0.t "), std::string::npos);
}

TEST(AnalysisReport, UnknownNamesGetTheNearest) {
  const lab::Analysed analysed = look_at(two_tasks(PreemptionMode::Os));
  for (const auto &[given, meant] : {std::pair{"fast.b", "fast.a"}, {"b", "slow.b"}, {"slwo", "slow"}}) {
    const Result<lab::Row> row = find_row(analysed, given);
    ASSERT_FALSE(row) << given;
    EXPECT_NE(row.error().front().hint.find(std::string("'") + meant + "'"), std::string::npos) << given;
  }
  EXPECT_EQ(row_of(analysed, "slow").name, "slow");
}

}  // namespace
}  // namespace redag::cli
