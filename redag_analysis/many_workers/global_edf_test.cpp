// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_edf.hpp"

#include <gtest/gtest.h>

#include <initializer_list>

#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/one_worker/edf_demand.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::expect_bound_holds;
using testing::for_cases;

BoundCaseLimits several_workers(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.policies = {PolicyKind::Edf};
  limits.max_workers = 4;
  limits.max_dags = 9;
  limits.jitter = limits.queues = limits.overheads = true;
  limits.max_deadline = 1.5;
  limits.max_utilization = 0.7;
  return limits;
}

TEST(BoundProperty, EdfGlobalDensity) {
  BoundCaseLimits limits = several_workers(sched::Preemption::Full);
  limits.max_deadline = 1.0;
  limits.max_utilization = 0.6;
  expect_bound_holds(edf_global_density(), cases(limits), {.workloads = 1500});
}

TEST(BoundProperty, EdfGlobalResponse) {
  expect_bound_holds(edf_global_response(), cases(several_workers(sched::Preemption::Full)), {.workloads = 1500});
}

TEST(BoundProperty, EdfGlobalResponseNonpreemptive) {
  BoundCaseLimits limits = several_workers(sched::Preemption::None);
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.5;
  expect_bound_holds(edf_global_response(), cases(limits), {.workloads = 1500});
}

// Few long tasks on two workers, simulated from many offsets.
TEST(BoundProperty, EdfGlobalResponseOfFewTasks) {
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits;
    limits.preemption = mode;
    limits.policies = {PolicyKind::Edf};
    limits.min_workers = limits.max_workers = 2;
    limits.max_dags = 5;
    limits.min_utilization = mode == sched::Preemption::Full ? 0.4 : 0.2;
    limits.max_utilization = mode == sched::Preemption::Full ? 0.9 : 0.7;
    limits.min_deadline = 0.3;
    limits.max_deadline = 1.2;
    limits.min_period = 3;
    limits.max_period = 14;
    limits.queues = true;
    expect_bound_holds(edf_global_response(), cases(limits), {.workloads = 1000, .runs = 20, .periods = 30});
  }
}

TaskSet edf_task_set(std::uint32_t workers, const std::vector<testing::Load> &tasks, sched::Preemption preemption) {
  return testing::compiled(testing::independent(tasks, workers, PolicyKind::Edf), preemption);
}

std::vector<std::optional<Duration>> responses(const Method &method, const TaskSet &task_set) {
  std::vector<std::optional<Duration>> result;
  const Outcome outcome = method.apply(task_set);
  for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) result.push_back(bound.response);
  return result;
}

using Responses = std::vector<std::optional<Duration>>;

// Task sets exactly on the limit and above it.
TEST(EdfGlobalDensity, LeavesRoomForTheLargest) {
  const auto full = sched::Preemption::Full;
  const Outcome three = edf_global_density().apply(edf_task_set(2, {{2, 4}, {2, 4}, {2, 4}}, full));
  EXPECT_EQ(std::get<Bound>(three).accepts, true) << "1.5 <= 2 - 0.5";
  const Outcome four = edf_global_density().apply(edf_task_set(2, {{2, 4}, {2, 4}, {2, 4}, {1, 100}}, full));
  EXPECT_EQ(std::get<Bound>(four).accepts, false);
  // S. Dhall, C. Liu, Operations Research 26(1), 1978: little work, and one task that needs nearly a whole worker.
  const Outcome dhall = edf_global_density().apply(edf_task_set(2, {{1, 9}, {1, 9}, {10, 10}}, full));
  EXPECT_EQ(std::get<Bound>(dhall).accepts, false);
}

// A job with a later deadline does not count. Here this is the other task's next job, which a bound for any order must
// count.
TEST(EdfGlobalResponse, CountsWhatIsDueInTime) {
  const TaskSet task_set = edf_task_set(1, {{2, 5}, {2, 5}}, sched::Preemption::Full);
  EXPECT_EQ(responses(edf_global_response(), task_set), (Responses{4, 4}));
  EXPECT_EQ(responses(dag_any(), task_set), (Responses{std::nullopt, std::nullopt}));
}

// The short task waits for 19 of the long one, which waits for one job of the short one.
TEST(EdfGlobalResponse, BlockingWithoutPreemption) {
  EXPECT_EQ(responses(edf_global_response(), edf_task_set(1, {{1, 100}, {20, 200}}, sched::Preemption::None)),
            (Responses{20, 21}));
  EXPECT_EQ(responses(edf_global_response(), edf_task_set(2, {{1, 100}, {20, 200}}, sched::Preemption::None)),
            (Responses{1, 20}));
}

// One task needs ten days of every second: its work within ten days is more than a duration can hold.
TEST(EdfGlobalResponse, ThereIsNoneBesideATaskFarBeyondItsLimit) {
  const Duration second = kSecond;
  const TaskSet task_set =
      edf_task_set(1, {{second / 3, second - 63}, {864'000 * second, second - 71}, {second / 3, second - 107}},
                   sched::Preemption::Full);
  EXPECT_EQ(responses(edf_global_response(), task_set), (Responses{std::nullopt, std::nullopt, std::nullopt}));
}

TEST(EdfGlobalResponse, IsNeverAboveThatForAnyOrder) {
  std::uint64_t smaller = 0;
  std::uint64_t compared = 0;
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits = several_workers(mode);
    limits.min_utilization = 0.1;
    limits.max_utilization = 0.6;
    for_cases(cases(limits), 2000, [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
      const Outcome any = dag_any().apply(task_set);
      const Outcome edf = edf_global_response().apply(task_set);
      if (!std::holds_alternative<Bound>(any)) return;
      for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
        const auto worse = std::get<Bound>(any).tasks[t].response;
        const auto better = std::get<Bound>(edf).tasks[t].response;
        if (!worse) continue;
        ASSERT_TRUE(better);
        // Without preemption the other task makes a job wait until its last tick.
        ASSERT_LE(*better, *worse);
        ++compared;
        if (*better < *worse) ++smaller;
      }
    });
  }
  EXPECT_GT(compared, 1000U);
  EXPECT_GT(smaller, 100U);
}

// On one worker the demand bound is exact for sporadic tasks: no sound test accepts more.
TEST(EdfGlobal, AcceptsNothingThatTheDemandOfOneWorkerRefuses) {
  BoundCaseLimits limits = several_workers(sched::Preemption::Full);
  limits.max_workers = 1;
  limits.max_deadline = 1.0;
  limits.jitter = false;
  std::uint64_t accepted = 0;
  for_cases(cases(limits), 3000, [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
    const Outcome demand = edf_demand().apply(task_set);
    if (!std::holds_alternative<Bound>(demand)) return;
    for (const Method &method : {edf_global_density(), edf_global_response()}) {
      const Outcome outcome = method.apply(task_set);
      if (!std::holds_alternative<Bound>(outcome)) continue;
      if (verdict(task_set, std::get<Bound>(outcome)) != Verdict::Schedulable) continue;
      ASSERT_EQ(std::get<Bound>(demand).accepts, true) << method.name;
      ++accepted;
    }
  });
  EXPECT_GT(accepted, 300U);
}

TEST(EdfGlobalResponse, MoreExecutionNeverShrinksABoundAndTermsAddUp) {
  std::uint64_t compared = 0;
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits = several_workers(mode);
    limits.min_utilization = 0.1;
    limits.max_utilization = 0.6;
    for_cases(cases(limits), 1500, [&](const testing::BoundCase &bound_case, const TaskSet &task_set, Rng &rng) {
      const Outcome before = edf_global_response().apply(task_set);
      if (!std::holds_alternative<Bound>(before)) return;
      for (const ResponseBound &bound : std::get<Bound>(before).tasks) {
        Duration sum = 0;
        for (const Term &term : bound.terms) sum += term.amount;
        ASSERT_EQ(sum, bound.response.value_or(0));
        ASSERT_EQ(bound.absent.empty(), bound.response.has_value());
      }
      Workload more = bound_case.workload;
      Dag &dag = more.dags[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(more.dags.size()) - 1))];
      ++dag.tasks.back().wcet;
      const auto larger = compile(more, bound_case.platform);
      if (!larger) return;
      const Outcome after = edf_global_response().apply(*larger);
      for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
        const Duration grown = std::get<Bound>(after).tasks[t].response.value_or(kNever);
        ASSERT_LE(std::get<Bound>(before).tasks[t].response.value_or(kNever), grown);
      }
      ++compared;
    });
  }
  EXPECT_GT(compared, 500U);
}

}  // namespace
}  // namespace redag::analysis
