// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The warning about a hyperperiod that one odd period makes huge.
#include "redag/loader/hyperperiod_warning.hpp"

#include <initializer_list>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/loader/workload_yaml.hpp"

namespace redag {
namespace {

std::string warnings(std::initializer_list<const char *> periods) {
  std::string text = "dags:\n- name: d\n  tasks:\n";
  int number = 0;
  for (const char *period : periods) text += fmt::format("  - {{name: t{}, wcet: 100ns, {}}}\n", number++, period);
  const Result<LoadedWorkload> loaded = parse_workload(text, "w.yaml");
  return loaded ? to_string(loaded->warnings) : to_string(loaded.error());
}

TEST(HyperperiodWarning, AnOddPeriodGetsRoundNeighbours) {
  EXPECT_EQ(
      warnings({"period: 10ms", "period: 33.333333ms", "period: 100ms"}),
      "w.yaml:5:37: warning: period 33.333333ms makes the hyperperiod 38d 14h, too long for a simulation to cover "
      "(33ms makes it 3.3s, 34ms makes it 1.7s; 'rate: 30Hz' says that it is meant)");
}

TEST(HyperperiodWarning, SeveralOddPeriodsAreOneWarning) {
  const std::string text = warnings({"period: 33.333333ms", "period: 16.666667ms", "period: 10ms"});
  EXPECT_NE(text.find("period 33.333333ms and 1 other make the hyperperiod longer than 146 years"), std::string::npos)
      << text;
  EXPECT_NE(text.find("if the other is rounded as well"), std::string::npos) << text;
}

TEST(HyperperiodWarning, ARateIsMeant) {
  EXPECT_EQ(warnings({"rate: 30Hz", "period: 10ms"}), "");
  const auto loaded = parse_workload(
      "dags: [{name: d, rate: 30Hz, tasks: [{name: a, wcet: 1ms}, {name: b, wcet: 1ms, period: 10ms}]}]", "w.yaml");
  ASSERT_TRUE(loaded);
  EXPECT_EQ(to_string(loaded->warnings), "");
  // Rounding the period that is not meant does not help.
  EXPECT_EQ(warnings({"rate: 30Hz", "period: 16.666667ms", "period: 10ms"}), "");
}

TEST(HyperperiodWarning, PeriodsThatFitOrThatNoRoundOneMendsAreNoWarning) {
  EXPECT_EQ(warnings({"period: 33.333333ms"}), "");
  EXPECT_EQ(warnings({"period: 33ms", "period: 10ms", "period: 7ms"}), "");
  EXPECT_EQ(warnings({"period: 2.5ms", "period: 333us", "period: 123.4ms"}), "");
  EXPECT_EQ(warnings({"period: 101ms", "period: 103ms", "period: 107ms", "period: 109ms", "period: 113ms"}), "");
}

TEST(HyperperiodWarning, BadPeriodsHaveNoHyperperiod) {
  Workload workload;
  workload.dags.emplace_back();
  for (const Duration period : {Duration{33'333'333}, Duration{0}, Duration{-5}, kNever}) {
    workload.dags[0].tasks.emplace_back().period = period;
    EXPECT_FALSE(hyperperiod_warning(workload, [](const TaskRef &) { return false; }));
  }
}

TEST(RoundedRate, IsAWholeRateUpToAThousand) {
  EXPECT_EQ(rounded_rate(33'333'333), 30);
  EXPECT_EQ(rounded_rate(16'666'667), 60);
  EXPECT_EQ(rounded_rate(33'333'334), std::nullopt);
  EXPECT_EQ(rounded_rate(2'500'000), std::nullopt) << "exact";
  EXPECT_EQ(rounded_rate(333'333), std::nullopt) << "3 kHz";
  EXPECT_EQ(rounded_rate(0), std::nullopt);
}

}  // namespace
}  // namespace redag
