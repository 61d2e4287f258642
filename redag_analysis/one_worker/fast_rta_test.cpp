// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/fast_rta.hpp"

#include <gtest/gtest.h>

#include "redag_analysis/one_worker/response_time.hpp"
#include "redag_testing/bound_property.hpp"

namespace redag::analysis {
namespace {

// By hand, from the Burns-Wellings set (3, 7), (3, 12), (5, 20): the last answers after 20.
TEST(FastRta, DecidesAtTheDeadline) {
  const std::vector<SimpleTask> exact = {{3, 7, 7}, {3, 12, 12}, {5, 20, 20}};
  EXPECT_TRUE(is_schedulable(exact));
  const std::vector<SimpleTask> late = {{3, 7, 7}, {3, 12, 12}, {5, 20, 19}};
  EXPECT_FALSE(is_schedulable(late));
  EXPECT_TRUE(is_schedulable({}));
}

TEST(FastRta, AgreesWithTheResponseTimeAnalysis) {
  testing::BoundCaseLimits limits;
  limits.max_dags = 12;
  limits.max_period = 500;
  limits.min_utilization = 0.6;
  int schedulable = 0;
  constexpr int kCases = 5000;
  for (int i = 0; i < kCases; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i) + 1000));
    testing::BoundCase bound_case = testing::random_bound_case(rng, limits);
    bound_case.workload.ties = Ties::Fixed;  // it knows one order of all tasks
    const auto system = compile(bound_case.workload, bound_case.platform);
    ASSERT_TRUE(system);
    std::vector<SimpleTask> tasks;
    for (const std::uint32_t t : system->by_rank) {
      tasks.push_back({system->tasks[t].wcet, system->tasks[t].period, system->tasks[t].deadline});
    }
    const Outcome outcome = rta_preemptive().apply(*system);
    const bool expected = verdict(*system, std::get<Bound>(outcome)) == Verdict::Schedulable;
    ASSERT_EQ(is_schedulable(tasks), expected) << describe(bound_case);
    schedulable += expected ? 1 : 0;
  }
  EXPECT_GT(schedulable, kCases / 10);
  EXPECT_LT(schedulable, kCases * 9 / 10);
}

}  // namespace
}  // namespace redag::analysis
