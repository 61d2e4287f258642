// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_sequential.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "redag_analysis/many_workers/global_dag.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::compiled;
using testing::expect_bound_holds;

BoundCaseLimits several_workers(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.max_workers = 4;
  limits.max_dags = 9;
  limits.jitter = limits.queues = limits.overheads = true;
  limits.max_deadline = 1.5;
  limits.max_utilization = 0.8;
  return limits;
}

TEST(BoundProperty, Guan) {
  expect_bound_holds(guan(), cases(several_workers(sched::Preemption::Full)), {.workloads = 2000});
}

// Few long tasks on two workers, simulated from many offsets, where a task that carries work in matters.
TEST(BoundProperty, GuanWithCarriedWork) {
  BoundCaseLimits limits;
  limits.min_workers = limits.max_workers = 2;
  limits.max_dags = 5;
  limits.min_utilization = 0.5;
  limits.max_utilization = 0.9;
  limits.min_period = 3;
  limits.max_period = 14;
  expect_bound_holds(guan(), cases(limits), {.workloads = 1500, .runs = 20, .periods = 30});
}

TEST(BoundProperty, SequentialNonpreemptive) {
  expect_bound_holds(sequential_nonpreemptive(), cases(several_workers(sched::Preemption::None)), {.workloads = 2000});
}

// Priorities in the order of the tasks.
Workload independent(std::uint32_t workers, const std::vector<testing::Load> &tasks) {
  return testing::independent(tasks, workers, PolicyKind::Fixed);
}

std::vector<std::optional<Duration>> responses(const Method &method, const TaskSet &task_set) {
  std::vector<std::optional<Duration>> result;
  const Outcome outcome = method.apply(task_set);
  for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) result.push_back(bound.response);
  return result;
}

// Two tasks in phase leave both workers idle for 2 of 4 ticks, and the third can use only one of them: its 7 take until
// 15. (A longer T_1 can hurt: B. Andersson, J. Jonsson, 2000.)
TEST(GlobalSequential, TasksInPhaseWasteWorkers) {
  const TaskSet task_set = compiled(independent(2, {{2, 4}, {2, 4}, {7, 100}}), sched::Preemption::Full);
  for (const Method &method : {guan(), dag_bounded()}) EXPECT_GE(responses(method, task_set)[2].value(), 15);
}

// An earlier job carries in all of its work but a tick; with less the last response would be 8. The values were
// computed from the paper's formula, without this code.
TEST(GlobalSequential, WhatIsCarriedInIsCutByOneTickOnly) {
  const TaskSet task_set = compiled(independent(2, {{2, 3}, {1, 3}, {4, 6}, {1, 9}}), sched::Preemption::Full);
  EXPECT_EQ(responses(guan(), task_set), (std::vector<std::optional<Duration>>{2, 1, 6, 9}));
}

TEST(GlobalSequential, TheMostUrgentOfEachWorkerNeverWait) {
  const TaskSet task_set = compiled(independent(3, {{4, 9}, {5, 9}, {6, 9}, {1, 90}}), sched::Preemption::Full);
  for (const Method &method : {dag_bounded(), guan()}) {
    const auto found = responses(method, task_set);
    EXPECT_EQ(found[0], 4);
    EXPECT_EQ(found[1], 5);
    EXPECT_EQ(found[2], 6);
    EXPECT_GT(found[3].value(), 1);
  }
}

// Two equals on two workers, below a more urgent task: each can wait for the other, and for no less urgent task. Guan's
// argument needs that the others preempt the task itself.
TEST(GlobalSequential, EqualsRelyOnEachOther) {
  Workload workload = independent(2, {{2, 10}, {3, 20}, {4, 20}, {5, 40}});
  workload.dags[2].tasks[0].priority = workload.dags[1].tasks[0].priority;
  const TaskSet shared = compiled(workload, sched::Preemption::Full);
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(guan().apply(shared)));
  const auto found = responses(dag_bounded(), shared);
  // The reference: each of the two is last in a fixed order.
  std::swap(workload.dags[1].tasks[0].wcet, workload.dags[2].tasks[0].wcet);
  std::swap(workload.dags[1].tasks[0].bcet, workload.dags[2].tasks[0].bcet);
  workload.ties = Ties::Fixed;
  const auto other_last = responses(dag_bounded(), compiled(workload, sched::Preemption::Full));
  EXPECT_GE(found[1].value(), other_last[2].value());
  EXPECT_GE(found[2].value(), found[1].value());
  EXPECT_GE(found[3].value(), found[2].value());
  const TaskSet none = compiled(workload, sched::Preemption::None);
  EXPECT_TRUE(responses(sequential_nonpreemptive(), none)[3]);

  // If one of them has no bound, neither has the other.
  workload = independent(2, {{6, 10}, {6, 10}, {9, 10}});
  for (Dag &dag : workload.dags) dag.tasks[0].priority = 0;
  for (const auto &response : responses(dag_bounded(), compiled(workload, sched::Preemption::Full))) {
    EXPECT_FALSE(response);
  }
}

// Without preemption even the most urgent tasks wait for a job that has just started: m = 2, (1, 10), 2 x (20, 200).
TEST(GlobalSequential, NonpreemptiveBlockingReachesTheMostUrgent) {
  const TaskSet task_set = compiled(independent(2, {{1, 100}, {20, 200}, {20, 200}}), sched::Preemption::None);
  const auto found = responses(sequential_nonpreemptive(), task_set);
  EXPECT_EQ(found[0], 20);  // either has 19 left, then its own 1
  const TaskSet short_period = compiled(independent(2, {{1, 10}, {20, 200}, {20, 200}}), sched::Preemption::None);
  EXPECT_FALSE(responses(sequential_nonpreemptive(), short_period)[0]);
}

TEST(GlobalSequential, GuanIsNeverAboveDagBounded) {
  const BoundCaseLimits limits = several_workers(sched::Preemption::Full);
  std::uint64_t smaller = 0;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    Rng rng(mix(seed));
    const testing::BoundCase bound_case = random_bound_case(rng, limits);
    const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
    if (!task_set.not_analysable.empty()) continue;
    const Outcome guans = guan().apply(task_set);
    const Outcome bounded = dag_bounded().apply(task_set);
    if (!std::holds_alternative<Bound>(guans)) continue;
    const auto &tasks = std::get<Bound>(bounded).tasks;
    const bool all_bounded = std::all_of(tasks.begin(), tasks.end(), [](const auto &task) { return task.response; });
    for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
      const auto better = std::get<Bound>(guans).tasks[t].response;
      const auto worse = std::get<Bound>(bounded).tasks[t].response;
      if (!worse) continue;
      // Below a task without a bound, only dag_bounded() goes on.
      ASSERT_TRUE(better || !all_bounded) << describe(bound_case);
      if (!better) continue;
      ASSERT_LE(*better, *worse) << describe(bound_case);
      if (*better < *worse) ++smaller;
    }
  }
  EXPECT_GT(smaller, 100U);
}

// Fixed points that begin at a more urgent task's are still the least ones.
TEST(GlobalSequential, WhereTheWindowsBeginDoesNotShow) {
  std::uint64_t later = 0;
  std::uint64_t compared = 0;
  testing::for_cases(cases(several_workers(sched::Preemption::Full)), 2000,
                     [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
                       global::Units view =
                           global::units_of(task_set, {.mode = sched::Preemption::Full, .edges = false});
                       if (view.reason) return;
                       for (std::size_t k = 0; k < view.units.size(); ++k) {
                         const Duration start = global::start_after(view.units, k);
                         const bool found = global::guan_response(view.units, k, view.workers, start);
                         const Duration response = view.units[k].response;
                         ASSERT_EQ(global::guan_response(view.units, k, view.workers, 0), found);
                         if (!found) return;
                         ASSERT_EQ(view.units[k].response, response);
                         ++compared;
                         if (start > 1) ++later;
                       }
                     });
  EXPECT_GT(compared, 2500U);
  EXPECT_GT(later, 500U);
}

// The least d with sum_i min(W_i, d) < m d, tried one after the other; W_i by the equations of the paper.
std::optional<Duration> guan_by_definition(const std::vector<global::GlobalUnit> &units, std::size_t k,
                                           std::uint32_t workers) {
  const global::GlobalUnit &own = units[k];
  for (Duration d = 1; d - 1 + own.volume + own.jitter <= own.limit; ++d) {
    const Duration x = d + own.volume - 1;
    Duration sum = 0;
    std::vector<Duration> carried;
    for (std::size_t i = 0; i < k; ++i) {
      const auto &[wcet, period, jitter] = std::tie(units[i].volume, units[i].period, units[i].jitter);
      const Duration fresh = (x + jitter) / period * wcet + std::min(wcet, (x + jitter) % period);
      const Duration whole = x < wcet ? -1 : (x - wcet) / period;
      const Duration rest = x - wcet - whole * period - (period - units[i].response);
      const Duration with = (whole + 1) * wcet + std::clamp<Duration>(rest, 0, jitter > 0 ? wcet : wcet - 1);
      sum += std::min(fresh, d);
      carried.push_back(std::min(std::max({with, fresh, wcet}), d) - std::min(fresh, d));
    }
    std::sort(carried.begin(), carried.end(), std::greater<>());
    for (std::size_t i = 0; i < carried.size() && i + 1 < workers; ++i) sum += carried[i];
    if (sum < Duration{workers} * d) return d - 1 + own.volume + own.jitter;
  }
  return std::nullopt;
}

// The steps skip windows, remember jobs from the last one, and look only at tasks that can carry in enough.
TEST(GlobalSequential, GuanFindsTheLeastWindow) {
  BoundCaseLimits limits = several_workers(sched::Preemption::Full);
  limits.min_period = 3;
  limits.max_period = 200;
  limits.max_dags = 12;
  std::uint64_t bounded = 0;
  std::uint64_t waiting = 0;
  testing::for_cases(cases(limits), 4000, [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
    global::Units view = global::units_of(task_set, {.mode = sched::Preemption::Full, .edges = false});
    if (view.reason) return;
    for (std::size_t k = 0; k < view.units.size(); ++k) {
      const bool found = global::guan_response(view.units, k, view.workers, global::start_after(view.units, k));
      const std::optional<Duration> response = guan_by_definition(view.units, k, view.workers);
      ASSERT_EQ(found, response.has_value());
      if (!found) return;
      ASSERT_EQ(view.units[k].response, *response);
      ++bounded;
      if (*response > view.units[k].volume + view.units[k].jitter) ++waiting;
    }
  });
  EXPECT_GT(bounded, 5000U);
  EXPECT_GT(waiting, 1000U);
}

// What a search remembers of the jobs in its windows is gone when the next one begins.
TEST(GlobalSequential, GuanSeesThatATaskHasChanged) {
  const TaskSet shorter = compiled(independent(2, {{2, 20}, {2, 20}, {30, 100}}), sched::Preemption::Full);
  const TaskSet longer = compiled(independent(2, {{6, 20}, {6, 20}, {30, 100}}), sched::Preemption::Full);
  std::vector<global::GlobalUnit> units = global::units_of(shorter, {}).units;
  for (std::size_t k = 0; k < 3; ++k) ASSERT_TRUE(global::guan_response(units, k, 2));
  const Duration before = units[2].response;
  units[0].volume = units[1].volume = units[0].response = units[1].response = 6;
  ASSERT_TRUE(global::guan_response(units, 2, 2));
  EXPECT_EQ(units[2].response, responses(guan(), longer)[2]);
  EXPECT_GT(units[2].response, before);
}

TEST(GlobalSequential, TermsAddUp) {
  BoundCaseLimits limits = several_workers(sched::Preemption::Full);
  for (std::uint64_t seed = 0; seed < 1500; ++seed) {
    Rng rng(mix(seed));
    limits.preemption = seed % 3 == 0 ? sched::Preemption::None : sched::Preemption::Full;
    const testing::BoundCase bound_case = random_bound_case(rng, limits);
    const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
    for (const Method &method : {guan(), sequential_nonpreemptive()}) {
      const Outcome outcome = method.apply(task_set);
      if (!std::holds_alternative<Bound>(outcome)) continue;
      for (const ResponseBound &bound : std::get<Bound>(outcome).tasks) {
        Duration sum = 0;
        for (const Term &term : bound.terms) sum += term.amount;
        ASSERT_EQ(sum, bound.response.value_or(0)) << method.name << describe(bound_case);
        ASSERT_EQ(bound.absent.empty(), bound.response.has_value());
      }
    }
  }
}

}  // namespace
}  // namespace redag::analysis
