// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/global_dag.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "redag_analysis/many_workers/dag_shapes.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCaseLimits;
using testing::cases;
using testing::compiled;
using testing::expect_bound_holds;
using testing::TestTask;
using testing::tick_dag;

BoundCaseLimits graphs(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.max_workers = 4;
  limits.edges = true;
  limits.max_dags = 4;
  limits.max_tasks = 8;
  limits.jitter = limits.overheads = true;
  limits.max_deadline = 1.5;
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.7;
  limits.min_period = 10;
  limits.max_period = 120;
  return limits;
}

BoundCaseLimits with_max_active(BoundCaseLimits limits) {
  limits.caps = true;
  return limits;
}

BoundCaseLimits tasks(sched::Preemption preemption) {
  BoundCaseLimits limits = graphs(preemption);
  limits.edges = false;
  limits.max_dags = 9;
  limits.queues = true;
  limits.max_utilization = 0.8;
  limits.min_period = 4;
  limits.max_period = 60;
  return limits;
}

TEST(BoundProperty, DagBoundedOfTasks) {
  expect_bound_holds(dag_bounded(), cases(tasks(sched::Preemption::Full)), {.workloads = 2000});
}

TEST(BoundProperty, DagAnyOfTasks) {
  BoundCaseLimits limits = tasks(sched::Preemption::Full);
  limits.policies = {PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::RateMonotonic};
  limits.max_utilization = 0.6;
  expect_bound_holds(dag_any(), cases(limits), {.workloads = 1000});
  limits.preemption = sched::Preemption::None;
  limits.max_utilization = 0.4;
  expect_bound_holds(dag_any(), cases(limits), {.workloads = 1000});
}

TEST(BoundProperty, DagBounded) {
  expect_bound_holds(dag_bounded(), cases(graphs(sched::Preemption::Full)), {.workloads = 1500, .from_source = true});
}

TEST(BoundProperty, DagBoundedWithMaxActive) {
  expect_bound_holds(dag_bounded(), cases(with_max_active(graphs(sched::Preemption::Full))),
                     {.workloads = 2000, .from_source = true});
}

TEST(BoundProperty, DagNonpreemptive) {
  expect_bound_holds(dag_nonpreemptive(), cases(graphs(sched::Preemption::None)),
                     {.workloads = 1500, .from_source = true});
}

TEST(BoundProperty, DagNonpreemptiveWithMaxActive) {
  expect_bound_holds(dag_nonpreemptive(), cases(with_max_active(graphs(sched::Preemption::None))),
                     {.workloads = 2000, .from_source = true});
}

// The least responses that agree with each other do not depend on where the rounds begin.
TEST(DagAny, KnowsNoOrderOfDags) {
  std::uint64_t compared = 0;
  BoundCaseLimits limits = graphs(sched::Preemption::Full);
  limits.policies = {PolicyKind::Fifo};
  for (std::uint64_t seed = 0; seed < 1000; ++seed) {
    Rng rng(seed);
    const testing::BoundCase drawn = testing::random_bound_case(rng, limits);
    Workload reversed = drawn.workload;
    std::reverse(reversed.dags.begin(), reversed.dags.end());
    const Outcome outcome = dag_any().apply(compile(drawn.workload, drawn.platform).value());
    const Outcome other = dag_any().apply(compile(reversed, drawn.platform).value());
    const auto *bound = std::get_if<Bound>(&outcome);
    if (bound == nullptr) continue;
    const std::size_t last = bound->dags.size() - 1;
    for (std::size_t d = 0; d <= last; ++d) {
      ASSERT_EQ(bound->dags[d].response, std::get<Bound>(other).dags[last - d].response) << "seed " << seed;
      compared += bound->dags[d].response ? 1U : 0U;
    }
  }
  EXPECT_GT(compared, 300U);
}

// Every policy, shared levels, and interleaved priorities of DAGs; also with max_active.
TEST(BoundProperty, DagAnyOrder) {
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits = graphs(mode);
    limits.max_utilization = 0.5;
    limits.policies = {PolicyKind::Edf, PolicyKind::Fifo};
    expect_bound_holds(dag_any(), cases(limits), {.workloads = 700});
    expect_bound_holds(dag_any(), cases(with_max_active(limits)), {.workloads = 700});
    limits.policies = {PolicyKind::Fixed, PolicyKind::RateMonotonic};
    limits.levels = mode == sched::Preemption::Full;
    expect_bound_holds(dag_any(), cases(with_max_active(limits)), {.workloads = 700});
  }
}

// Five stages of one task and two parallel ones, above a wide DAG whose tasks start whenever the upper DAG is narrow.
// If blocking counted only once per preemption, the bound would be 44; the schedule takes 52.
Workload narrow_and_wide() {
  std::vector<TestTask> narrow;
  std::vector<std::uint32_t> before;
  for (int stage = 0; stage < 5; ++stage) {
    const auto first = static_cast<std::uint32_t>(narrow.size());
    const std::string name = std::to_string(stage);
    narrow.push_back({"one" + name, stage == 0 ? 200 : 0, 1, before});
    narrow.push_back({"left" + name, 0, 4, {first}});
    narrow.push_back({"right" + name, 0, 4, {first}});
    before = {first + 1, first + 2};
  }
  narrow.push_back({"end", 0, 1, before});
  std::vector<TestTask> wide = {{"begin", 1000, 1}};
  for (int i = 0; i < 8; ++i) wide.push_back({"part" + std::to_string(i), 0, 8, {0}});
  wide.push_back({"end", 0, 1, {1, 2, 3, 4, 5, 6, 7, 8}});
  return testing::make_workload({tick_dag("narrow", narrow), tick_dag("wide", wide)}, 2);
}

ResponseBound dag_response(const Method &method, const TaskSet &task_set, std::size_t dag) {
  return std::get<Bound>(method.apply(task_set)).dags[dag];
}

// DAGs that are narrow and wide in turn, above a wide one with longer tasks. Random graphs hardly ever look like this.
testing::BoundCase narrow_and_wide_case(Rng &rng, sched::Preemption preemption, bool bounds) {
  testing::BoundCase result;
  result.platform.workers = static_cast<std::uint32_t>(rng.uniform(2, 4));
  result.platform.preemption = preemption;
  result.workload.name = "random";
  result.workload.platform.workers = result.platform.workers;
  const auto add_dag = [&](std::int64_t stages, Duration longest, Duration period) {
    std::vector<TestTask> tasks;
    std::vector<std::uint32_t> before;
    for (std::int64_t stage = 0; stage < stages; ++stage) {
      const auto first = static_cast<std::uint32_t>(tasks.size());
      const std::int64_t width = stage % 2 == 0 ? 1 : rng.uniform(2, result.platform.workers + 2);
      std::vector<std::uint32_t> now;
      for (std::int64_t i = 0; i < width; ++i) {
        const Duration wcet = rng.uniform(1, stage % 2 == 0 ? 2 : longest);
        now.push_back(first + static_cast<std::uint32_t>(i));
        tasks.push_back({"t" + std::to_string(now.back()), stage == 0 ? period : 0, wcet, before});
      }
      before = now;
    }
    const auto max_active = static_cast<std::uint32_t>(bounds && rng.uniform(0, 1) == 0 ? rng.uniform(1, 3) : 0);
    result.workload.dags.push_back(tick_dag("d" + std::to_string(result.workload.dags.size()), tasks, max_active));
  };
  add_dag(rng.uniform(1, 7), 4, 150);
  if (rng.uniform(0, 2) == 0) add_dag(rng.uniform(1, 3), 4, 200);
  add_dag(rng.uniform(1, 4), 12, 400);
  return result;
}

TEST(BoundProperty, DagNonpreemptiveNarrowAndWide) {
  for (const bool bounds : {false, true}) {
    const auto generator = [bounds](Rng &rng) { return narrow_and_wide_case(rng, sched::Preemption::None, bounds); };
    expect_bound_holds(dag_nonpreemptive(), generator, {.workloads = 1500, .periods = 5, .from_source = true});
  }
}

TEST(BoundProperty, DagBoundedNarrowAndWide) {
  for (const bool bounds : {false, true}) {
    const auto generator = [bounds](Rng &rng) { return narrow_and_wide_case(rng, sched::Preemption::Full, bounds); };
    expect_bound_holds(dag_bounded(), generator, {.workloads = 1000, .periods = 5, .from_source = true});
  }
}

TEST(GlobalDag, LessUrgentWorkStartsWheneverTheUpperDagIsNarrow) {
  const TaskSet task_set = compiled(narrow_and_wide(), sched::Preemption::None);
  EXPECT_EQ(task_set.units[0].length, 26);
  EXPECT_EQ(task_set.units[0].volume, 46);
  EXPECT_GE(dag_response(dag_nonpreemptive(), task_set, 0).response.value(), 52);
}

TEST(GlobalDag, AloneItNeverWaitsIfEachReadyTaskFindsAWorker) {
  Workload workload = narrow_and_wide();
  workload.dags.resize(1);
  const TaskSet task_set = compiled(workload, sched::Preemption::Full);
  EXPECT_EQ(dag_response(dag_bounded(), task_set, 0).response, 26) << "no more than two tasks are ready at once";
}

TEST(GlobalDag, MaxActiveOfOneIsTheVolume) {
  Workload workload = narrow_and_wide();
  workload.dags.resize(1);
  workload.dags[0].max_active = 1;
  EXPECT_EQ(dag_response(dag_bounded(), compiled(workload, sched::Preemption::Full), 0).response, 46);
}

// The upper DAG never has more than two tasks in progress, the lower one eight.
TEST(GlobalDag, AMaxActiveThatTasksCannotReachIsNone) {
  Workload workload = narrow_and_wide();
  const TaskSet without = compiled(workload, sched::Preemption::Full);
  workload.dags[0].max_active = 2;
  workload.dags[1].max_active = 8;
  const TaskSet with = compiled(workload, sched::Preemption::Full);
  for (const std::size_t dag : {0U, 1U}) {
    EXPECT_EQ(dag_response(dag_bounded(), with, dag).response, dag_response(dag_bounded(), without, dag).response);
  }
  workload.dags[1].max_active = 7;
  const Outcome outcome = dag_shapes().apply(compiled(workload, sched::Preemption::Full));
  EXPECT_TRUE(std::holds_alternative<NotApplicable>(outcome));
}

template <class Compare>
std::uint64_t compare_all(const BoundCaseLimits &limits, int count, Compare compare) {
  std::uint64_t compared = 0;
  for (int i = 0; i < count; ++i) {
    Rng rng(mix(static_cast<std::uint64_t>(i)));
    const testing::BoundCase bound_case = random_bound_case(rng, limits);
    const TaskSet task_set = compile(bound_case.workload, bound_case.platform).value();
    if (task_set.not_analysable.empty() && compare(bound_case, task_set)) ++compared;
  }
  return compared;
}

// On one worker a DAG is a task with C = its volume, and its response is known exactly.
TEST(GlobalDag, OnOneWorkerItIsNotBelowTheExactResponse) {
  BoundCaseLimits limits = graphs(sched::Preemption::Full);
  limits.max_workers = 1;
  limits.jitter = limits.overheads = false;
  std::uint64_t equal = 0;
  const auto compared = compare_all(limits, 1000, [&](const testing::BoundCase &bound_case, const TaskSet &task_set) {
    const Outcome exact = rta_preemptive().apply(task_set);
    const Outcome outcome = dag_bounded().apply(task_set);
    if (!std::holds_alternative<Bound>(exact) || !std::holds_alternative<Bound>(outcome)) return false;
    for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
      const Duration found = std::get<Bound>(outcome).dags[d].response.value_or(kNever);
      const Duration known = std::get<Bound>(exact).dags[d].response.value_or(kNever);
      EXPECT_GE(found, known) << describe(bound_case);
      if (found == known) ++equal;
    }
    return true;
  });
  EXPECT_GT(compared, 300U);
  EXPECT_GT(equal, 300U);
}

TEST(GlobalDag, MoreExecutionNeverShrinksABound) {
  const auto compared =
      compare_all(with_max_active(graphs(sched::Preemption::Full)), 1000,
                  [](const testing::BoundCase &bound_case, const TaskSet &task_set) {
                    Workload more = bound_case.workload;
                    Task &grown = more.dags[more.dags.size() / 2].tasks.back();
                    ++grown.wcet;
                    const auto larger = compile(more, bound_case.platform);
                    if (!larger) return false;  // above its deadline
                    for (const Method &method : {dag_bounded(), dag_any()}) {
                      const Outcome before = method.apply(task_set);
                      if (!std::holds_alternative<Bound>(before)) return false;
                      const Outcome after = method.apply(*larger);
                      for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
                        const Duration grown_response = std::get<Bound>(after).tasks[t].response.value_or(kNever);
                        EXPECT_LE(std::get<Bound>(before).tasks[t].response.value_or(kNever), grown_response)
                            << method.name << describe(bound_case);
                      }
                    }
                    return true;
                  });
  EXPECT_GT(compared, 300U);
}

// Knowledge of the order helps where jobs are preempted.
TEST(GlobalDag, AnyOrderIsNeverBelowBounded) {
  std::uint64_t larger = 0;
  const auto compared =
      compare_all(with_max_active(graphs(sched::Preemption::Full)), 1900,
                  [&](const testing::BoundCase &bound_case, const TaskSet &task_set) {
                    const Outcome any = dag_any().apply(task_set);
                    const Outcome bounded = dag_bounded().apply(task_set);
                    if (!std::holds_alternative<Bound>(any) || !std::holds_alternative<Bound>(bounded)) return false;
                    for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
                      const auto worse = std::get<Bound>(any).dags[d].response;
                      if (!worse) continue;
                      const auto better = std::get<Bound>(bounded).dags[d].response;
                      EXPECT_LE(better.value(), *worse) << describe(bound_case);
                      if (*better < *worse) ++larger;
                    }
                    return true;
                  });
  EXPECT_GT(compared, 300U);
  EXPECT_GT(larger, 100U);
}

TEST(GlobalDag, TermsAddUp) {
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    compare_all(with_max_active(graphs(mode)), 700, [](const testing::BoundCase &bound_case, const TaskSet &task_set) {
      for (const Method &method : {dag_bounded(), dag_nonpreemptive(), dag_any()}) {
        const Outcome outcome = method.apply(task_set);
        if (!std::holds_alternative<Bound>(outcome)) continue;
        for (const ResponseBound &bound : std::get<Bound>(outcome).dags) {
          Duration sum = 0;
          for (const Term &term : bound.terms) sum += term.amount;
          EXPECT_EQ(sum, bound.response.value_or(0)) << method.name << describe(bound_case);
        }
      }
      return true;
    });
  }
}

}  // namespace
}  // namespace redag::analysis
