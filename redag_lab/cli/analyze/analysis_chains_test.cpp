// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_chains.hpp"

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

// Returns on one worker a sensor (T 10, C 3) above a DAG of two tasks (T 20, C 2 and 5), in milliseconds.
lab::Analysed sensor_and_pipeline() {
  const Workload workload =
      testing::make_workload({testing::make_dag("sensor", {{"read", 10, 3}}),
                              testing::make_dag("pipeline", {{"first", 20, 2}, {"second", 0, 5, {0}}})},
                             1, PreemptionMode::Os);
  Result<lab::Analysed> analysed = lab::analyse(workload, analysis::platform_of(workload));
  EXPECT_TRUE(analysed) << to_string(analysed.error());
  return *std::move(analysed);
}

TEST(AnalysisChains, OverSeveralDags) {
  const lab::Analysed analysed = sensor_and_pipeline();
  const Result<ChainRow> row = find_chain(analysed, "sensor.read,pipeline.first,pipeline.second");
  ASSERT_TRUE(row) << to_string(row.error());
  const auto &bound = std::get<analysis::ChainBound>(row->bound);
  ASSERT_EQ(bound.segments.size(), 2U);  // the edge hands over from job to job
  EXPECT_EQ(bound.segments[1].response, (2 + 5 + 3) * kMillisecond);
  EXPECT_EQ(bound.age(), (10 + 3 + 20 + 10) * kMillisecond);
  // The sensor ends before a pipeline of the same release starts: 10 + max(3, 20) + 10.
  EXPECT_EQ(bound.reaction(), 40 * kMillisecond);
  EXPECT_FALSE(row->let);  // the last task is no timer

  const std::string text = describe(analysed, {*row}, StreamTraits{});
  EXPECT_NE(text.find("sensor.read > pipeline.first > pipeline.second"), std::string::npos) << text;
  EXPECT_NE(text.find("  pipeline.first to pipeline.second adds 30ms: period 20ms, response 10ms\n"), std::string::npos)
      << text;
  const Json json = to_json(analysed, {*row});
  EXPECT_EQ(json[0]["reaction_ns"], 40 * kMillisecond);
  EXPECT_EQ(json[0]["segments"].size(), 2U);
}

TEST(AnalysisChains, OfTimersLogicalExecutionTimeIsExact) {
  const Result<ChainRow> row = find_chain(sensor_and_pipeline(), "sensor.read,pipeline.first");
  ASSERT_TRUE(row);
  // Data that arrives right after 10 is read at 20 and written at 30, then read at 40 and written at 60.
  EXPECT_EQ(row->let, 50 * kMillisecond);
}

TEST(AnalysisChains, WithoutACommonClockThereIsNoLogicalExecutionTime) {
  const auto let = [](Workload workload) {
    return find_chain(lab::analyse(workload, analysis::platform_of(workload)).value(), "a.s,b.y")->let;
  };
  Workload workload = testing::make_workload({testing::make_dag("a", {{"s", 10}}), testing::make_dag("b", {{"y", 10}})},
                                             1, PreemptionMode::Os);
  EXPECT_EQ(let(workload), 30 * kMillisecond);
  Workload processes = workload;
  processes.dags[1].executor = 1;
  EXPECT_FALSE(let(processes)) << "up to just under 40 ms";
  workload.dags[1].tasks[0].phase = Phase::Event;
  EXPECT_FALSE(let(workload));
}

TEST(AnalysisChains, SaysWhatIsWrongWithAName) {
  const lab::Analysed analysed = sensor_and_pipeline();
  for (const char *chain : {"", "sensor.read,", "sensor.raed", "pipeline"}) {
    const Result<ChainRow> row = find_chain(analysed, chain);
    ASSERT_FALSE(row) << chain;
    EXPECT_FALSE(row.error().front().message.empty());
  }
}

}  // namespace
}  // namespace redag::cli
