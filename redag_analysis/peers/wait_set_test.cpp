// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/peers/wait_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "redag_analysis/analyze/executors.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

testing::BoundGenerator callbacks(std::uint32_t workers, double utilization, bool edges) {
  testing::BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.max_workers = workers;
  limits.edges = edges;
  limits.max_dags = 4;
  limits.jitter = limits.caps = limits.overheads = true;
  limits.min_utilization = 0.02;
  limits.max_utilization = utilization;
  limits.min_period = 20;
  limits.max_period = 300;
  return testing::cases(limits);
}

// Tests the bound under the model of the executor with this number of threads.
void expect_holds(const Method &method, std::uint32_t workers, double utilization) {
  for (const bool edges : {true, false}) {
    const testing::BoundPropertyOptions options{.workloads = 700, .executor = workers == 1 ? "ste" : "mte"};
    testing::expect_bound_holds(method, callbacks(workers, utilization, edges), options);
  }
}

TEST(BoundProperty, WaitSet) {
  expect_holds(wait_set(), 1, 0.3);
  expect_holds(wait_set(), 4, 0.3);
}
Workload three_timers(std::uint32_t workers) {
  Workload workload = testing::independent({{3, 100}, {5, 100}, {7, 100}}, workers);
  workload.platform.preemption = PreemptionMode::None;
  return workload;
}

TEST(WaitSetBound, EveryOtherCallbackOnceAndThoseBeforeTwice) {
  for (const std::uint32_t workers : {1U, 2U}) {
    const TaskSet task_set = testing::compiled(three_timers(workers));
    const Outcome outcome = wait_set().apply(task_set);
    const auto &bound = std::get<Bound>(outcome);
    EXPECT_EQ(bound.tasks[0].response, 3 + (5 + 7) / workers);
    EXPECT_EQ(bound.tasks[1].response, 5 + (3 + 7 + 3) / workers);
    EXPECT_EQ(bound.tasks[2].response, 7 + (3 + 5 + 3 + 5) / workers);
  }
}

// Cases with edges and without.
testing::BoundGenerator mixed(std::uint32_t workers) {
  return [workers](Rng &rng) { return callbacks(workers, 0.5, rng.uniform(0, 1) == 0)(rng); };
}

TEST(WaitSetBound, MoreExecutionNeverShrinksABoundAndTermsAddUp) {
  std::uint64_t compared = 0;
  for (const std::uint32_t workers : {1U, 4U}) {
    for_cases(mixed(workers), 2000, [&](const testing::BoundCase &bound_case, const TaskSet &task_set, Rng &rng) {
      Workload more = bound_case.workload;
      Dag &dag = more.dags[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(more.dags.size()) - 1))];
      ++dag.tasks[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(dag.tasks.size()) - 1))].wcet;
      const auto larger = compile(more, bound_case.platform);
      for (const Method &method : executor_methods()) {
        const Outcome before = method.apply(task_set);
        if (!std::holds_alternative<Bound>(before)) continue;
        for (const ResponseBound &bound : std::get<Bound>(before).dags) {
          Duration sum = 0;
          for (const Term &term : bound.terms) sum += term.amount;
          ASSERT_EQ(sum, bound.response.value_or(0)) << method.name;
          ASSERT_EQ(bound.absent.empty(), bound.response.has_value());
        }
        if (!larger) continue;
        const Outcome after = method.apply(*larger);
        for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
          const Duration grown = std::get<Bound>(after).dags[d].response.value_or(kNever);
          ASSERT_LE(std::get<Bound>(before).dags[d].response.value_or(kNever), grown) << method.name;
          ++compared;
        }
      }
    });
  }
  EXPECT_GT(compared, 1000U);
}

TEST(WaitSetBound, TimesNearTheLargestDoNotWrap) {
  for (const std::uint32_t workers : {1U, 4U}) {
    Workload workload = three_timers(workers);
    for (Dag &dag : workload.dags) {
      Task &task = dag.tasks[0];
      task.wcet = task.bcet = kMaxDuration / 8;
      task.period = task.deadline = kMaxDuration / 2;
    }
    const TaskSet task_set = testing::compiled(workload);
    for (const Method &method : executor_methods()) {
      const Outcome outcome = method.apply(task_set);
      if (!std::holds_alternative<Bound>(outcome)) continue;
      for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) {
        const Duration least = kMaxDuration / 8 + kMaxDuration / 4 / workers - 1;
        EXPECT_GE(bound.response.value_or(least), least) << method.name;
      }
    }
  }
}

}  // namespace
}  // namespace redag::analysis
