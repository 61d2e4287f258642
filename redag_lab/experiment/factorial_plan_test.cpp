// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include "tests/testing/repository.hpp"

namespace redag::experiment {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::vector<std::string> executors_of(World world) {
  if (world == World::Ros2) return {"redag", "mte", "events"};
  return {"redag", "redag-none", "mte", "ste", "mte-fifo"};
}

constexpr const char *kCart = "\nworkloads: {name: cart, file: workloads/paper/nonharmonic_u08.yaml}\n";

Result<FactorialPlan> parse(const std::string &text) {
  const std::string file = (testing::repository() / "plan.yaml").string();
  const Result<yaml::Node> root = yaml::parse(text, file);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return read_factorial_plan(*root, file, executors_of);
}

FactorialPlan parsed(const std::string &text) {
  const Result<FactorialPlan> plan = parse(text);
  EXPECT_TRUE(plan) << (plan ? "" : to_string(plan.error()));
  return plan.value_or(FactorialPlan{});
}

std::string errors_of(const std::string &text) {
  const Result<FactorialPlan> plan = parse(text);
  EXPECT_FALSE(plan);
  return plan ? "" : to_string(plan.error());
}

TEST(FactorialPlan, WhatItSaysIsWhatItMeans) {
  const FactorialPlan plan = parsed(std::string("experiment: factorial\nname: all\nworld: threads\nseed: 7\n"
                                                "repetitions: 3\nduration: 2s\nwarm_up: 100ms\n"
                                                "overheads: {release: 1us, preempt: 3us}\n"
                                                "workers: [1, 2]\npolicies: [edf, fifo]\ndeadline_scale: [0.8, 1]\n"
                                                "demand_scale: 2\nutilization: {from: 0.5, to: 0.7, step: 0.1}\n"
                                                "max_active: [unbounded, 3, [1, 2]]\n"
                                                "executors: [ideal, redag, mte]") +
                                    kCart);
  EXPECT_EQ(plan.world, World::Threads);
  EXPECT_EQ(plan.overheads.dispatch, 0);
  EXPECT_EQ(plan.overheads.preempt, 3 * kMicrosecond);
  EXPECT_EQ(plan.warm_up, 100 * kMillisecond);
  const std::vector<Factor> factors = factors_of(plan);
  const auto levels = [&](FactorPlace place) { return factors[place].levels; };
  EXPECT_THAT(levels(kWorkload), ElementsAre("cart"));
  EXPECT_THAT(levels(kPolicy), ElementsAre("edf", "fifo"));
  EXPECT_THAT(levels(kUtilization), ElementsAre("0.5", "0.6", "0.7"));
  EXPECT_THAT(levels(kDemandScale), ElementsAre("2"));
  EXPECT_THAT(levels(kMaxActive), ElementsAre("unbounded", "3", "1+2"));
}

TEST(FactorialPlan, PointsAreTheCombinationsThatDiffer) {
  const FactorialPlan plan = parsed(
      std::string("experiment: factorial\nworkers: [1, 2, 4]\nmax_active: [unbounded, 1]\npolicies: [edf, fifo]\n"
                  "deadline_scale: [0.8, 1.2]\nexecutors: [unlimited, ideal, redag, mte, ste]") +
      kCart);
  std::vector<int> count(5, 0);
  const std::vector<Point> points = points_of(plan);
  for (const Point &point : points) ++count.at(point[kExecutor]);
  EXPECT_THAT(count, ElementsAre(2, 6, 24, 6, 2));
  for (const Point &point : points) EXPECT_EQ(std::count(points.begin(), points.end(), point), 1);
  EXPECT_EQ(describe(factors_of(plan), points.back()),
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
        "plan.yaml:4:18: error: deadline_scale must be above 0",
        "plan.yaml:6:14: error: max_active must be a whole number", "plan.yaml:8:5: error: a workload is a file",
        "plan.yaml:9:5: error: the workload 'no/such.yaml' cannot be used",
        "plan.yaml:10:1: error: unknown key 'worker'", "did you mean 'workers'?"}) {
    EXPECT_THAT(errors, HasSubstr(words));
  }
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [redga]") + kCart),
              HasSubstr("plan.yaml:2:12: error: there is no executor 'redga' (did you mean 'redag'?)"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [mte-fifo]") + kCart),
              HasSubstr("the simulator has no threads"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [redag]\nmax_active: [[1, 2, 3]]") + kCart),
              HasSubstr("plan.yaml:3:13: error: 3 bounds are given, but 'cart' has 2 DAGs"));
  EXPECT_THAT(errors_of(std::string("experiment: factorial\nexecutors: [redag]\nworkers: [1, 1]") + kCart),
              HasSubstr("workers lists a value twice"));
  EXPECT_THAT(errors_of("experiment: factorial\nexecutors: [redag]\nworkloads:\n  - {name: r, random: {dags: 2}}\n"),
              HasSubstr("random workloads need a utilization"));
}

}  // namespace
}  // namespace redag::experiment
