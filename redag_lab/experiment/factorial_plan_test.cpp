// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> executors_of(World world) {
  if (world == World::Ros2) return {"redag", "mte", "events"};
  return {"redag", "redag-none", "mte", "ste", "mte-fifo"};
}

constexpr const char *kCart = R"(
workloads:
  - name: cart
    text: |
      name: cart
      platform: {workers: 1}
      dags:
        - name: a
          tasks: [{name: t, wcet: 1ms, period: 10ms}]
        - name: b
          tasks: [{name: u, wcet: 2ms, period: 20ms}]
)";

FactorialPlan parsed(const std::string &text) {
  const Result<FactorialPlan> plan = parse_factorial_plan(text, "plan.yaml", executors_of);
  EXPECT_TRUE(plan) << (plan ? "" : to_string(plan.error()));
  return plan.value_or(FactorialPlan{});
}

std::string errors_of(const std::string &text) {
  const Result<FactorialPlan> plan = parse_factorial_plan(text, "plan.yaml", executors_of);
  EXPECT_FALSE(plan);
  return plan ? "" : to_string(plan.error());
}

TEST(FactorialPlan, WhatItSaysIsWhatItMeans) {
  const FactorialPlan plan = parsed(std::string("experiment: factorial\nname: all\nworld: threads\nseed: 7\n"
                                                "repetitions: 3\nduration: 2s\nwarm_up: 100ms\nquantiles: true\n"
                                                "overheads: {release: 1us, preempt: 3us}\npaper_startup: 10ms\n"
                                                "workers: [1, 2]\npolicies: [edf, fifo]\ndeadline_scale: [0.8, 1]\n"
                                                "demand_scale: 2\nutilization: {from: 0.5, to: 0.7, step: 0.1}\n"
                                                "max_active: [unbounded, 3, [1, 2], {from: 2, to: 3}]\n"
                                                "executors: [ideal, redag, mte]") +
                                    kCart);
  EXPECT_EQ(plan.world, World::Threads);
  EXPECT_EQ(plan.overheads.dispatch, 0);
  EXPECT_EQ(plan.overheads.preempt, 3 * kMicrosecond);
  EXPECT_EQ(plan.warm_up, 100 * kMillisecond);
  const std::vector<Factor> factors = factors_of(plan);
  const auto levels = [&](FactorKind kind) { return factors[static_cast<std::size_t>(kind)].levels; };
  EXPECT_THAT(levels(FactorKind::Workload), ElementsAre("cart"));
  EXPECT_THAT(levels(FactorKind::Policy), ElementsAre("edf", "fifo"));
  EXPECT_THAT(levels(FactorKind::Utilization), ElementsAre("0.5", "0.6", "0.7"));
  EXPECT_THAT(levels(FactorKind::DemandScale), ElementsAre("2"));
  EXPECT_THAT(levels(FactorKind::MaxActive), ElementsAre("unbounded", "3", "1+2", "2+2", "2+3", "3+2", "3+3"));
}

TEST(FactorialPlan, CanonicalTextGivesThePlanBack) {
  const FactorialPlan plan =
      parsed(std::string("experiment: factorial\nworkers: [1, 2]\nutilization: [0.5]\n"
                         "max_active: [unbounded, [1, 2]]\nexecutors: [redag, ste]") +
             kCart + "  - {name: drawn, random: {dags: 2, tasks: 3, shape: chain, bcet: 0.5, deadline: 0.6}}\n");
  const std::string text = to_yaml(plan);
  const FactorialPlan again = parsed(text);
  EXPECT_EQ(to_yaml(again), text);
  EXPECT_EQ(again.workloads.at(0).workload, plan.workloads.at(0).workload);
  EXPECT_EQ(again.workloads.at(1).random->shape, lab::DagShape::Chain);
  EXPECT_EQ(again.workloads.at(1).random->deadline_min, 0.6);
  EXPECT_EQ(points_of(again), points_of(plan));
}

TEST(FactorialPlan, WorkloadFilesLieBesideThePlan) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / ("factorial_plan_test_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "w.yaml") << "name: other\nplatform: {workers: 1}\ndags:\n  - name: d\n    tasks: [{name: t, "
                                      "wcet: 1ms, period: 10ms}]\n";
  std::ofstream(folder / "plan.yaml") << "experiment: factorial\nworkloads: w.yaml\nexecutors: redag\n";
  const Result<FactorialPlan> plan = load_factorial_plan((folder / "plan.yaml").string(), executors_of);
  ASSERT_TRUE(plan) << to_string(plan.error());
  EXPECT_EQ(plan->workloads.at(0).name, "w");
  EXPECT_EQ(plan->workloads.at(0).workload.name, "other");
  std::filesystem::remove_all(folder);
}

// A factor that does not affect an executor does not multiply its runs.
TEST(FactorialPlan, PointsAreTheCombinationsThatDiffer) {
  const FactorialPlan plan = parsed(
      std::string("experiment: factorial\nworkers: [1, 2, 4]\nmax_active: [unbounded, 1]\npolicies: [edf, fifo]\n"
                  "deadline_scale: [0.8, 1.2]\nexecutors: [unlimited, ideal, redag, mte, ste]") +
      kCart);
  std::vector<int> count(5, 0);
  const std::vector<FactorialPoint> points = points_of(plan);
  for (const FactorialPoint &point : points) ++count.at(point.of(FactorKind::Executor));
  EXPECT_THAT(count, ElementsAre(2, 6, 24, 6, 2));
  for (const FactorialPoint &point : points) EXPECT_EQ(std::count(points.begin(), points.end(), point), 1);
  EXPECT_EQ(describe(plan, points.back()),
            "workload cart, policy fifo, workers 4, deadline_scale 1.2, max_active 1, executor redag");
}

// The demand at a utilization per worker depends on the number of workers, also for executors with one worker.
TEST(FactorialPlan, WorkersMatterToAllWhereTheyMakeTheDemand) {
  const FactorialPlan plan =
      parsed(std::string("experiment: factorial\nworkers: [1, 2]\nutilization: [0.5, 1]\nexecutors: [ste]") + kCart);
  EXPECT_EQ(points_of(plan).size(), 4U);
}

TEST(FactorialPlan, WorldsHaveTheirExecutors) {
  const FactorialPlan plan =
      parsed(std::string("experiment: factorial\nworld: ros2\nworkers: [1, 2]\nexecutors: [mte, events]") + kCart);
  EXPECT_EQ(points_of(plan).size(), 3U);  // events has one thread
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [events]") + kCart),
              HasSubstr("there is no executor 'events'"));
}

TEST(FactorialPlan, MistakesHaveTheirPlaceAndAHint) {
  const std::string errors = errors_of(
      "experiment: factorial\nworld: reality\nworkers: [two]\ndeadline_scale: [-1]\nexecutors: [redag]\n"
      "max_active: [{from: 3, to: 2}]\nworkloads:\n  - {name: x}\n  - no/such.yaml\nworker: 1\n");
  for (const char *words :
       {"plan.yaml:2:8: error: ", "plan.yaml:3:11: error: workers must be a whole number",
        "plan.yaml:4:17: error: deadline_scale: '-1' is neither a range nor a list of values",
        "plan.yaml:6:14: error: max_active: 'from' and 'to'", "plan.yaml:8:5: error: a workload is a file",
        "plan.yaml:9:5: error: the workload 'no/such.yaml' cannot be used",
        "plan.yaml:10:1: error: unknown key 'worker'", "did you mean 'workers'?"}) {
    EXPECT_THAT(errors, HasSubstr(words));
  }
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [redga]") + kCart),
              HasSubstr("plan.yaml:2:12: error: there is no executor 'redga' (did you mean 'redag'?)"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [mte-fifo]") + kCart),
              HasSubstr("the simulator has no threads"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [mte]\nmax_active: [2]") + kCart),
              HasSubstr("max_active have no meaning for the executors of this plan"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [redag]\nmax_active: [[1, 2, 3]]") + kCart),
              HasSubstr("plan.yaml:3:13: error: 3 bounds are given, but 'cart' has 2 DAGs"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [redag]\nworkers: [1, 1]") + kCart),
              HasSubstr("workers lists a value twice"));
  EXPECT_THAT(errors_of("experiment: factorial\nexecutors: [redag]\nworkloads:\n  - {name: r, random: {dags: 2}}\n"),
              HasSubstr("random workloads need a utilization"));
  EXPECT_THAT(errors_of("experiment: acceptance\n"), HasSubstr("this is a plan for 'redag experiment acceptance'"));
  EXPECT_THAT(errors_of(""), HasSubstr("the file has no plan"));
}

}  // namespace
}  // namespace redag::experiment
