// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/tuning_report.hpp"

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

Workload short_deadline() {
  return testing::make_workload({testing::make_dag("a", {{"t", 10, 3}}),
                                 testing::make_dag("b", {{.name = "t", .period = 20, .wcet = 2, .deadline = 4}})},
                                1, PreemptionMode::Os);
}

Tuning by_bounds(const Workload &workload) {
  Tuning tuning;
  tuning.options.judge = lab::Judge::Bounds;
  tuning.options.freedom.workers = false;
  tuning.options.freedom.priorities = true;
  tuning.options.held_out = 0;
  tuning.tuned = *lab::tune(workload, tuning.options);
  return tuning;
}

TEST(TuningReport, TellsChangesAndGainsByBounds) {
  const Tuning tuning = by_bounds(short_deadline());
  EXPECT_EQ(changes(tuning.tuned), std::vector<std::string>{"policy: rate_monotonic -> deadline_monotonic"});
  const std::string words = in_words(tuning);
  EXPECT_NE(words.find("gain: the bounds now prove that every deadline is met\n"), std::string::npos) << words;
  EXPECT_NE(words.find("least slack, by the bounds: 0 without a bound, -25.0 % -> 0 without a bound, 50.0 %\n"),
            std::string::npos)
      << words;
  const Json document = to_json(tuning);
  EXPECT_EQ(document["best"]["searched"]["least_slack"], 0.5);
  EXPECT_EQ(document["best"]["priorities"], "deadline_monotonic");
  EXPECT_EQ(document["present"]["searched"]["proven"], false);
}

TEST(TuningReport, PrioritiesAreListedTaskByTask) {
  Workload workload = short_deadline();
  workload.policy = PolicyKind::Fixed;
  workload.dags[0].tasks[0].priority = 7;
  const std::vector<std::string> expected = {"policy: fixed -> deadline_monotonic", "priority of a.t: 7 -> none"};
  EXPECT_EQ(changes(by_bounds(workload).tuned), expected);
}

TEST(TuningReport, WithoutBoundsThereIsNothingToCompare) {
  Workload workload = short_deadline();
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) task.wcet = task.bcet = kSecond;
  }
  const std::string words = in_words(by_bounds(workload));
  EXPECT_EQ(words.find("nothing to compare: "), 0U) << words;
}

}  // namespace
}  // namespace redag::cli
