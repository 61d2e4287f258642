// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "redag_testing/repository.hpp"

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string errors_of(const std::string &text) {
  const Result<AcceptancePlan> plan = parse_acceptance_plan(text, "plan.yaml");
  return plan ? "" : to_string(plan.error());
}

TEST(AcceptancePlan, TextReadsBackAsTheSamePlan) {
  AcceptancePlan plan;
  plan.name = "some-name";
  plan.seed = 18'446'744'073'709'551'615ULL;
  plan.sets = 7;
  plan.utilization = {50'000, 333'333, 1};
  plan.dags = {2, 5};
  plan.workers = {8};
  plan.deadlines = {DeadlineKind::Constrained, DeadlineKind::Implicit};
  plan.preemption = {PreemptionMode::Os};
  plan.methods = {"guan", "simulation"};
  plan.simulation = {0, 3};
  plan.workload.min_tasks = 3;
  plan.workload.max_tasks = 8;
  plan.workload.shape = lab::DagShape::ForkJoin;
  plan.workload.edge_probability = 0.1;
  plan.workload.max_active_max = 2;
  plan.workload.max_active_min = 2;
  plan.workload.periods = lab::PeriodModel::Robot;
  plan.workload.period_min = 1'500'000;
  plan.workload.jitter = 0.05;
  const Result<AcceptancePlan> read = parse_acceptance_plan(to_yaml(plan), "plan.yaml");
  ASSERT_TRUE(read) << to_string(read.error()) << to_yaml(plan);
  EXPECT_EQ(to_yaml(*read), to_yaml(plan));
  EXPECT_EQ(read->utilization, plan.utilization);
  EXPECT_EQ(read->seed, plan.seed);
  EXPECT_EQ(read->workload.max_active_min, 2U);
}

TEST(AcceptancePlan, DefaultsAndShortForms) {
  const Result<AcceptancePlan> plan = parse_acceptance_plan(
      "experiment: acceptance\nworkers: 2\npreemption: os\nutilization: {from: 0.1, to: 0.3, step: 0.1}\n"
      "workload: {tasks: 4}\n",
      "plan.yaml");
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
  EXPECT_THAT(errors, HasSubstr("plan.yaml:5:14: error: utilization: '0.1:x' is neither a range nor a list of values"));
  EXPECT_THAT(errors, HasSubstr("plan.yaml:6:"));
  EXPECT_THAT(errors, HasSubstr("did you mean 'layered'?"));
}

TEST(AcceptancePlan, WhatMakesNoSense) {
  const std::string head = "experiment: acceptance\n";
  EXPECT_THAT(errors_of(head + "methods: [guan, gaun]\n"), HasSubstr("plan.yaml:2:10: error: unknown method 'gaun' "));
  EXPECT_THAT(errors_of(head + "methods: [any, any]\n"), HasSubstr("lists a value twice"));
  EXPECT_THAT(errors_of(head + "preemption: cooperative\n"), HasSubstr("no preemption points"));
  EXPECT_THAT(errors_of(head + "dags: []\n"), HasSubstr("dags has no values"));
  EXPECT_THAT(errors_of(head + "name: a/b\n"), HasSubstr("a name consists of one or more letters"));
  // Two tasks cannot use four workers. The generator reports the mistake, and the plan reader its place.
  EXPECT_THAT(errors_of(head + "dags: 2\nworkload: {tasks: 1}\n"), HasSubstr("plan.yaml:3:11: error: 2 DAGs"));
  EXPECT_THAT(errors_of("name: x\n"), HasSubstr("the key 'experiment' is missing"));
  EXPECT_THAT(errors_of("experiment: figure\n"), HasSubstr("unknown experiment 'figure'"));
  EXPECT_THAT(errors_of("experiment: factorial\n"), HasSubstr("this is a plan for 'redag experiment factorial'"));
  EXPECT_THAT(errors_of("sets: 1\n"), HasSubstr("write 'experiment: acceptance'"));
  EXPECT_THAT(errors_of(""), HasSubstr("the file has no plan"));
}

// Points are counted before they are created, and workloads are drawn only where this takes little time.
TEST(AcceptancePlan, WhatWouldNeverEndIsRefusedAtOnce) {
  std::string numbers = "1";
  for (int i = 2; i <= 10'000; ++i) numbers += "," + std::to_string(i);
  EXPECT_THAT(errors_of("experiment: acceptance\nutilization: 0.0001:1:0.0001\ndags: [" + numbers + "]\nworkers: [" +
                        numbers + "]\n"),
              HasSubstr("more than 100000 points"));
  EXPECT_THAT(errors_of("experiment: acceptance\ndags: 900000\n"), HasSubstr("plan.yaml:2:7: error: 900000 DAGs"));
}

TEST(AcceptancePlan, Utilizations) {
  EXPECT_THAT(*parse_utilization("0.05:0.2:0.05"), ElementsAre(50'000, 100'000, 150'000, 200'000));
  EXPECT_THAT(*parse_utilization("0.5"), ElementsAre(500'000));
  EXPECT_THAT(*parse_utilization("0.9,0.1"), ElementsAre(900'000, 100'000));
  for (const char *bad : {"", "0", "-1", "0.5:0.1:0.1", "0:1:0.1", "0.1:1", "0.1:1:0", "nan", "1e9", "a", "0.1,,0.2"}) {
    EXPECT_FALSE(parse_utilization(bad)) << bad;
  }
}

TEST(AcceptancePlan, OrderOfPoints) {
  AcceptancePlan plan;
  plan.utilization = {100'000, 200'000};
  const std::vector<AcceptancePoint> points = points_of(plan);
  ASSERT_THAT(points, SizeIs(4));
  EXPECT_EQ(points[0].preemption, PreemptionMode::None);
  EXPECT_EQ(points[1].utilization, 200'000U);
  EXPECT_EQ(points[2].preemption, PreemptionMode::Os);
}

TEST(AcceptancePlan, ThoseOfTheRepository) {
  int seen = 0;
  for (const auto &entry : std::filesystem::directory_iterator(testing::repository() / "experiments")) {
    if (entry.path().extension() != ".yaml") continue;
    const Result<AcceptancePlan> plan = load_acceptance_plan(entry.path());
    EXPECT_TRUE(plan) << to_string(plan.error());
    ++seen;
  }
  EXPECT_GT(seen, 1);
}

}  // namespace
}  // namespace redag::experiment
