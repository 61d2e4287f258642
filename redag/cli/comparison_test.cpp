#include "redag/cli/comparison.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace redag::cli {
namespace {

// An executor whose one DAG misses these shares in its repetitions.
ExecutorResults results(const std::string &name, const std::vector<double> &misses) {
  ExecutorResults made;
  made.variant = *parse_variant(name);
  made.preemption = "none";
  for (const double miss : misses) {
    Observation seen;
    seen.jobs = 1000;
    seen.finished = 1000;
    seen.miss_ratio = miss / 2;
    seen.miss_ratio_with_lost = miss;
    seen.response.count = 1000;
    seen.response.p99 = kMillisecond;
    made.repetitions.push_back({seen, seen});
  }
  return made;
}

std::string verdict(std::vector<ExecutorResults> executors) {
  Comparison comparison;
  comparison.workload = "w";
  comparison.dags = {"control", "total"};
  comparison.executors = std::move(executors);
  return verdicts(comparison).at(0);
}

TEST(Spread, MedianAndRange) {
  const Spread odd = report::spread_of({3, 1, 2});
  EXPECT_EQ(odd.median, 2);
  EXPECT_EQ(odd.min, 1);
  EXPECT_EQ(odd.max, 3);
  EXPECT_EQ(report::spread_of({4, 1, 2, 3}).median, 2.5);
}

TEST(Verdict, OneIsBest) {
  EXPECT_EQ(verdict({results("redag", {0, 0, 0.001}), results("mte", {0.14, 0.142, 0.15})}),
            "control: redag misses 0.0 %, mte 14.2 %: redag misses fewest");
}

TEST(Verdict, OursIsNotFlattered) {
  EXPECT_EQ(verdict({results("redag", {0.2, 0.2}), results("ste", {0.1, 0.1})}),
            "control: redag misses 20.0 %, ste 10.0 %: ste misses fewest");
}

TEST(Verdict, RangesThatTouchAreNoDifference) {
  EXPECT_EQ(verdict({results("redag", {0.10, 0.12, 0.20}), results("mte", {0.12, 0.15, 0.16})}),
            "control: redag misses 12.0 %, mte 15.0 %: no clear difference");
}

TEST(Verdict, NobodyMisses) {
  EXPECT_EQ(verdict({results("redag", {0, 0}), results("mte", {0, 0})}),
            "control: redag misses 0.0 %, mte 0.0 %: nobody misses");
}

TEST(Verdict, GroupsThoseThatAreAlike) {
  EXPECT_EQ(verdict({results("redag", {0}), results("redag-os", {0}), results("mte", {0.1}), results("ste", {0.3})}),
            "control: redag misses 0.0 %, redag-os 0.0 %, mte 10.0 %, ste 30.0 %: redag and redag-os miss none, "
            "mte and ste miss more");
}

TEST(Caveat, SaysWhoHadRealTimeThreads) {
  Comparison comparison;
  comparison.executors = {results("redag", {0}), results("mte", {0})};
  EXPECT_EQ(caveat(comparison), "");
  comparison.executors[0].realtime = true;
  EXPECT_EQ(caveat(comparison).find("redag had real-time (SCHED_FIFO) threads, mte had not"), 0U);
  comparison.executors[1].realtime = true;
  EXPECT_EQ(caveat(comparison), "");
}

TEST(Comparison, CsvHasARowForEveryRepetitionAndQuotesNames) {
  Comparison comparison;
  comparison.dags = {"a,\"b\"", "total"};
  comparison.executors = {results("redag", {0.5, 0.25})};
  const std::string text = to_csv(comparison);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 3);
  EXPECT_NE(text.find("\nredag,\"a,\"\"b\"\"\",1,1000,1000,0,0,0,0.25,0.5,"), std::string::npos) << text;
}

TEST(Comparison, JsonHasEveryRepetition) {
  Comparison comparison;
  comparison.dags = {"control", "total"};
  comparison.executors = {results("redag", {0.5, 0.25, 0.75})};
  const Json document = to_json(comparison);
  const Json &dag = document["executors"][0]["dags"][0];
  EXPECT_EQ(document["executors"][0]["dags"].size(), 1U) << "the total stands beside the DAGs";
  EXPECT_EQ(dag["miss_ratio_with_lost"]["median"], 0.5);
  EXPECT_EQ(dag["repetitions"].size(), 3U);
}

}  // namespace
}  // namespace redag::cli
