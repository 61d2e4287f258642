// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/sensitivity_report.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/testing/builders.hpp"

namespace redag::cli {
namespace {

Workload tight_deadline() {
  return testing::make_workload({testing::make_dag("a", {{"t", 10, 3}}),
                                 testing::make_dag("b", {{.name = "t", .period = 20, .wcet = 2, .deadline = 4}})},
                                1, PreemptionMode::Os);
}

TEST(SensitivityReport, FactorsAreNeverRoundedUp) {
  Workload workload = tight_deadline();
  workload.dags[1].tasks[0].deadline = 20 * kMillisecond;
  Sensitivity sensitivity;
  const analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  sensitivity.analysed = lab::analyse(workload, platform).value();
  for (const lab::Knob &knob : lab::knobs_of(workload, sensitivity.analysed.task_set)) {
    sensitivity.results.push_back({lab::margin_of(workload, platform, knob).value(), {}});
  }
  sensitivity.knobs = sensitivity.results.size();
  // Harmonic periods with U = 0.4 leave a factor of 2.5, and 14 ms of 20 for b alone.
  EXPECT_EQ(in_words(sensitivity).find("all execution times together can grow to 2.5000 times"), 0U);
  sensitivity.results[0].margin.factor = 2.49999;
  EXPECT_EQ(in_words(sensitivity).find("all execution times together can grow to 2.4999 times"), 0U);
  EXPECT_EQ(knob_name(sensitivity.analysed, sensitivity.results[3].margin.knob), "wcet of b.t");
  EXPECT_EQ(to_json(sensitivity)["limits"][3]["limit_ns"], 14 * kMillisecond);
  sensitivity.results[2].margin.again = 9 * kMillisecond;
  EXPECT_NE(in_words(sensitivity).find("with gaps: wcet of a.t passes again at 9ms, above its limit"),
            std::string::npos);
}

// A reason that limits many rows stands below the table once, and in the document with each.
TEST(SensitivityReport, ReasonsStandBelowTheTableOnce) {
  Workload workload = tight_deadline();
  for (Dag &dag : workload.dags) dag.tasks[0].budget = kMillisecond;  // below the wcet: no method applies
  const analysis::AnalysisPlatform platform = analysis::platform_of(workload);
  Sensitivity sensitivity;
  sensitivity.analysed = lab::analyse(workload, platform).value();
  for (const lab::Knob &knob : lab::knobs_of(workload, sensitivity.analysed.task_set)) {
    sensitivity.results.push_back({lab::margin_of(workload, platform, knob).value(), {}});
  }
  sensitivity.knobs = sensitivity.results.size();
  std::string text = describe(sensitivity, {}, false);
  text.erase(0, text.find("what "));  // the verdict above the table gives the reason of the workload as it is
  std::map<std::string, std::size_t> rows;
  for (const KnobResult &result : sensitivity.results) {
    if (!result.margin.reason.empty()) ++rows[result.margin.reason];
  }
  const auto count = [&](const std::string &part) {
    std::size_t found = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
    return found;
  };
  ASSERT_EQ(rows.size(), 2U) << text;
  std::size_t most = 0;
  for (const auto &[reason, number] : rows) {
    EXPECT_EQ(count(reason), 1U) << text;
    most = std::max(most, number);
  }
  EXPECT_GT(most, 1U);
  EXPECT_EQ(count("no method applies [1]") + count("no method applies [2]"), sensitivity.results.size()) << text;
  const Json rates = to_json(sensitivity)["limits"][1];
  EXPECT_EQ(rates["obstacle"], "no method applies: " + sensitivity.results[1].margin.reason);
}

}  // namespace
}  // namespace redag::cli
