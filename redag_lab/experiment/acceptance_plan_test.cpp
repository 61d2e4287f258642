// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

Result<AcceptancePlan> parse(const std::string &text) {
  const Result<yaml::Node> root = yaml::parse(text, "plan.yaml");
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return read_acceptance_plan(*root, "plan.yaml");
}

std::string errors_of(const std::string &text) {
  const Result<AcceptancePlan> plan = parse(text);
  return plan ? "" : to_string(plan.error());
}

TEST(AcceptancePlan, WhatItSaysIsWhatItMeans) {
  const Result<AcceptancePlan> plan = parse(
      "experiment: acceptance\nname: some-name\nseed: 18446744073709551615\nsets: 7\nutilization: [0.05, 0.333333]\n"
      "dags: [2, 5]\nworkers: 8\npreemption: os\nmethods: [guan, simulation]\n"
      "simulation: {offsets: 0, periods: 3}\n"
      "workload: {tasks: {min: 3, max: 8}, shape: fork_join, max_task_utilization: 0.5}\n");
  ASSERT_TRUE(plan) << to_string(plan.error());
  EXPECT_EQ(plan->name, "some-name");
  EXPECT_EQ(plan->seed, 18'446'744'073'709'551'615ULL);
  EXPECT_EQ(plan->sets, 7U);
  EXPECT_THAT(plan->utilization, ElementsAre(50'000, 333'333));
  EXPECT_THAT(plan->preemption, ElementsAre(PreemptionMode::Os));
  EXPECT_THAT(plan->methods, ElementsAre("guan", "simulation"));
  EXPECT_EQ(plan->simulation, (SimulationEffort{0, 3}));
  EXPECT_EQ(plan->workload.shape, lab::DagShape::ForkJoin);
  EXPECT_EQ(plan->workload.max_tasks, 8U);
  EXPECT_EQ(plan->workload.max_task_utilization, 0.5);
}

TEST(AcceptancePlan, DefaultsAndShortForms) {
  const Result<AcceptancePlan> plan = parse(
      "experiment: acceptance\nworkers: 2\npreemption: os\nutilization: {from: 0.1, to: 0.3, step: 0.1}\n"
      "workload: {tasks: 4}\n");
  ASSERT_TRUE(plan) << to_string(plan.error());
  EXPECT_THAT(plan->workers, ElementsAre(2));
  EXPECT_THAT(plan->utilization, ElementsAre(100'000, 200'000, 300'000));
  EXPECT_EQ(plan->workload.min_tasks, 4U);
  EXPECT_EQ(plan->workload.max_tasks, 4U);
  EXPECT_THAT(AcceptancePlan().utilization, SizeIs(20));
  EXPECT_EQ(AcceptancePlan().utilization.back(), kMillion);
}

TEST(AcceptancePlan, EveryMistakeHasItsPlace) {
  const std::string errors = errors_of(
      "experiment: acceptance\n"
      "setz: 3\n"
      "workers: [0, 2]\n"
      "preemption: [none, oss]\n"
      "utilization: 0.1:x\n"
      "workload: {tasks: {min: 3, mx: 4}, shape: layerd}\n");
  EXPECT_THAT(errors, HasSubstr("plan.yaml:2:1: error: unknown key 'setz' in a plan (did you mean 'sets'?)"));
  EXPECT_THAT(errors, HasSubstr("plan.yaml:3:11: error: workers must be a whole number"));
  EXPECT_THAT(errors, HasSubstr("plan.yaml:4:20: error: "));
  EXPECT_THAT(errors, HasSubstr("did you mean 'os'?"));
  EXPECT_THAT(errors, HasSubstr("plan.yaml:5:14: error: utilization must be a number"));
  EXPECT_THAT(errors, HasSubstr("plan.yaml:6:"));
  EXPECT_THAT(errors, HasSubstr("did you mean 'layered'?"));
}

TEST(AcceptancePlan, WhatMakesNoSense) {
  const std::string head = "experiment: acceptance\n";
  EXPECT_THAT(errors_of(head + "methods: [guan, gaun]\n"), HasSubstr("plan.yaml:2:10: error: unknown method 'gaun' "));
  EXPECT_THAT(errors_of(head + "methods: [any, any]\n"), HasSubstr("lists a value twice"));
  EXPECT_THAT(errors_of(head + "preemption: cooperative\n"), HasSubstr("preemption must be one of none, os"));
  EXPECT_THAT(errors_of(head + "dags: []\n"), HasSubstr("dags has no values"));
  EXPECT_THAT(errors_of(head + "name: a/b\n"), HasSubstr("a name consists of one or more letters"));
  // Two tasks cannot use four workers. The generator reports the mistake, and the plan reader its place.
  EXPECT_THAT(errors_of(head + "dags: 2\nworkload: {tasks: 1}\n"), HasSubstr("plan.yaml:3:11: error: dags 2, "));
}

// Points are counted before they are created, and workloads are drawn only where this takes little time.
TEST(AcceptancePlan, WhatWouldNeverEndIsRefusedAtOnce) {
  std::string numbers = "1";
  for (int i = 2; i <= 10'000; ++i) numbers += "," + std::to_string(i);
  EXPECT_THAT(errors_of("experiment: acceptance\nutilization: {from: 0.0001, to: 1, step: 0.0001}\ndags: [" + numbers +
                        "]\nworkers: [" + numbers + "]\n"),
              HasSubstr("more than 1000000 combinations"));
  EXPECT_THAT(errors_of("experiment: acceptance\ndags: 900000\n"), HasSubstr("plan.yaml:2:7: error: dags 900000"));
}

TEST(AcceptancePlan, Utilizations) {
  const auto utilization = [](const std::string &text) {
    const Result<AcceptancePlan> plan = parse("experiment: acceptance\nutilization: " + text + "\n");
    return plan ? plan->utilization : std::vector<std::uint32_t>{};
  };
  EXPECT_THAT(utilization("{from: 0.05, to: 0.2, step: 0.05}"), ElementsAre(50'000, 100'000, 150'000, 200'000));
  EXPECT_THAT(utilization("0.5"), ElementsAre(500'000));
  EXPECT_THAT(utilization("[0.9, 0.1]"), ElementsAre(900'000, 100'000));
  for (const char *bad : {"0", "-1", "{from: 0.5, to: 0.1, step: 0.1}", "{from: 0, to: 1, step: 0.1}", "nan", "1e9",
                          "a", "{from: 0.1, to: 1}", "[0.1, ]x", "\"1\""}) {
    EXPECT_THAT(utilization(bad), ::testing::IsEmpty()) << bad;
  }
}

TEST(AcceptancePlan, OrderOfPoints) {
  AcceptancePlan plan;
  plan.utilization = {100'000, 200'000};
  const std::vector<Point> points = Acceptance(plan).points();
  EXPECT_THAT(points, ElementsAre(Point{0, 0, 0, 0}, Point{0, 0, 0, 1}, Point{0, 0, 1, 0}, Point{0, 0, 1, 1}));
}

}  // namespace
}  // namespace redag::experiment
