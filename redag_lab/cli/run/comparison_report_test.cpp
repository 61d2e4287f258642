// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/comparison_report.hpp"
#include "redag_analysis/text/tint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace redag::cli {
namespace {

// Returns an executor whose one DAG misses these shares of 1 000 jobs in its repetitions, and responds after 1 ms.
lab::ExecutorResults results(const std::string &name, const std::vector<double> &misses) {
  lab::ExecutorResults made;
  made.variant = *lab::parse_variant(name);
  made.preemption = "none";
  for (const double miss : misses) {
    metrics::DagSummary seen;
    seen.jobs.released = 1000;
    seen.jobs.finished = 1000;
    seen.jobs.late = static_cast<std::uint64_t>(std::lround(miss * 1000));
    seen.end_to_end.response.count = 1000;
    seen.end_to_end.response.p99 = kMillisecond;
    seen.end_to_end.response.max = kMillisecond;
    seen.end_to_end.sinks.resize(1);
    metrics::DagSummary total = seen;
    total.end_to_end = {};
    made.repetitions.push_back({seen, total});
  }
  return made;
}

lab::Comparison comparison_of(std::vector<lab::ExecutorResults> executors) {
  lab::Comparison comparison;
  comparison.workload = "w";
  comparison.dags = {"control", "total"};
  comparison.executors = std::move(executors);
  return comparison;
}

std::string verdict(std::vector<lab::ExecutorResults> executors) {
  return verdicts(comparison_of(std::move(executors))).at(0);
}

TEST(Spread, MedianAndRange) {
  const lab::Spread odd = report::spread_of({3, 1, 2});
  EXPECT_EQ(odd.median, 2);
  EXPECT_EQ(odd.min, 1);
  EXPECT_EQ(odd.max, 3);
  EXPECT_EQ(report::spread_of({4, 1, 2, 3}).median, 2.5);
}

TEST(Verdict, OneIsBest) {
  EXPECT_EQ(verdict({results("redag", {0, 0, 0.001}), results("mte", {0.14, 0.142, 0.15})}),
            "control: redag misses 0.033 % (1 of 3 000), mte 14.4 %: redag misses fewest");
}

TEST(Verdict, OursIsNotFlattered) {
  EXPECT_EQ(verdict({results("redag", {0.2, 0.2}), results("ste", {0.1, 0.1})}),
            "control: redag misses 20.0 %, ste 10.0 %: ste misses fewest");
}

TEST(Verdict, RangesThatTouchAreNoDifference) {
  EXPECT_EQ(verdict({results("redag", {0.10, 0.12, 0.20}), results("mte", {0.12, 0.15, 0.16})}),
            "control: redag misses 14.0 %, mte 14.3 %: no clear difference");
}

TEST(Verdict, NoDeadlineMissed) {
  EXPECT_EQ(verdict({results("redag", {0, 0}), results("mte", {0, 0})}),
            "control: redag misses none, mte none: no deadline missed");
}

TEST(Verdict, GroupsThoseThatAreAlike) {
  EXPECT_EQ(verdict({results("redag", {0}), results("redag-os", {0}), results("mte", {0.1}), results("ste", {0.3})}),
            "control: redag misses none, redag-os none, mte 10.0 %, ste 30.0 %: redag and redag-os miss none, "
            "mte and ste miss more");
}

TEST(Caveat, SaysWhoHadRealTimeThreads) {
  lab::Comparison comparison;
  comparison.executors = {results("redag", {0}), results("mte", {0})};
  EXPECT_EQ(caveat(comparison), "");
  comparison.executors[0].realtime = true;
  EXPECT_EQ(caveat(comparison).find("redag had real-time (SCHED_FIFO) threads, mte had not"), 0U);
  comparison.executors[1].realtime = true;
  EXPECT_EQ(caveat(comparison), "");
}

// Returns the executor's row of the table.
std::string table_row(const lab::Comparison &comparison, const std::string &executor, bool colour = false) {
  const std::string text = describe(comparison, StreamTraits{.colour = colour, .width = 0});
  const std::size_t name = text.find(executor, text.find("executor"));
  return text.substr(name, text.find('\n', name) - name);
}

TEST(Comparison, MaximaAreOfAllRepetitions) {
  lab::ExecutorResults three = results("redag", {0, 0, 0});
  three.repetitions[1][0].end_to_end.response.max = 9 * kMillisecond;
  three.repetitions[2][0].end_to_end.response.p99 = 3 * kMillisecond;
  EXPECT_EQ(three.longest_end_to_end(0), 9 * kMillisecond) << "not the median of the maxima";
  EXPECT_EQ(three.end_to_end(0, &metrics::Distribution::p99)->median, kMillisecond);
  const lab::Comparison comparison = comparison_of({three});
  EXPECT_NE(table_row(comparison, "redag").find("9ms"), std::string::npos) << table_row(comparison, "redag");
  EXPECT_EQ(to_json(comparison)["executors"][0]["dags"][0]["end_to_end_max_ns"], 9 * kMillisecond);
  EXPECT_NE(describe(comparison, StreamTraits{}).find("max is the largest of all repetitions; p50 to p99 are medians"),
            std::string::npos);
}

TEST(Comparison, OneMissIsShownAndNotGreen) {
  const lab::ExecutorResults once = results("redag", {0, 0.001, 0});
  const std::string row = table_row(comparison_of({once}), "redag", true);
  EXPECT_NE(row.find(tinted("1 (0.033 %)", Tint::Bad, true)), std::string::npos) << row;
  EXPECT_TRUE(once.has_misses());
  const std::string clean = table_row(comparison_of({results("redag", {0})}), "redag", true);
  const std::string green = tinted("x", Tint::Good, true).substr(0, 5);
  EXPECT_NE(clean.find(green), std::string::npos) << clean;
  EXPECT_EQ(row.find(green), std::string::npos) << row;
}

TEST(Comparison, ARepetitionWithoutAnAnswerHasNoPercentile) {
  lab::ExecutorResults two = results("redag", {1, 1});
  two.repetitions[0][0].end_to_end.response = {};
  EXPECT_EQ(two.end_to_end(0, &metrics::Distribution::p99)->min, kMillisecond) << "not 0 of the silent one";
  two.repetitions[1][0].end_to_end.response = {};
  EXPECT_FALSE(two.end_to_end(0, &metrics::Distribution::p99));
  EXPECT_FALSE(two.longest_end_to_end(0));
  EXPECT_TRUE(to_json(comparison_of({two}))["executors"][0]["dags"][0]["end_to_end_max_ns"].is_null());
}

TEST(Comparison, LateEndToEndIsAMiss) {
  lab::ExecutorResults late = results("redag", {0, 0});
  EXPECT_FALSE(late.has_misses());
  late.repetitions[1][0].end_to_end.late = 1;
  EXPECT_TRUE(late.has_misses());
}

TEST(Comparison, JsonHasMediansOfTheRepetitions) {
  lab::Comparison comparison;
  comparison.dags = {"control", "total"};
  comparison.executors = {results("redag", {0.5, 0.25, 0.75})};
  const Json document = to_json(comparison);
  const Json &dag = document["executors"][0]["dags"][0];
  EXPECT_EQ(document["executors"][0]["dags"].size(), 1U) << "the total stands beside the DAGs";
  EXPECT_EQ(dag["miss_ratio_with_lost"]["median"], 0.5);
}

}  // namespace
}  // namespace redag::cli
