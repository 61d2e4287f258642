// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/dag_shapes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "redag_analysis/core/rate_edges.hpp"
#include "redag_analysis/many_workers/dag_isolated.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using global::Shape;
using testing::BoundCaseLimits;
using testing::cases;
using testing::compiled;
using testing::expect_bound_holds;
using testing::for_cases;
using testing::make_workload;
using testing::tick_dag;

BoundCaseLimits graphs() {
  BoundCaseLimits limits;
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

TEST(BoundProperty, DagShapes) {
  expect_bound_holds(dag_shapes(), cases(graphs()), {.workloads = 2000, .from_source = true});
}

// Short periods and two workers, from many offsets, where a job that is carried in or cut off matters.
TEST(BoundProperty, DagShapesAtTheEndsOfWindows) {
  BoundCaseLimits limits = graphs();
  limits.min_workers = limits.max_workers = 2;
  limits.max_dags = 3;
  limits.jitter = limits.overheads = false;
  limits.min_utilization = 0.4;
  limits.max_utilization = 0.9;
  limits.min_period = 6;
  limits.max_period = 30;
  expect_bound_holds(dag_shapes(), cases(limits), {.workloads = 1000, .runs = 20, .periods = 20, .from_source = true});
}

TEST(BoundProperty, RatesDagShapes) {
  BoundCaseLimits limits = graphs();
  limits.rates = true;
  limits.max_dags = 3;
  limits.max_tasks = 5;
  limits.max_utilization = 0.5;
  expect_bound_holds(dag_shapes(), cases(limits), {.workloads = 300, .runs = 6, .from_source = true});
}

// Tasks of 1, then 4 and 2 in parallel, then 1.
Workload fork_and_join(std::uint32_t workers) {
  return make_workload(
      {tick_dag("upper", {{"begin", 20, 1}, {"left", 0, 4, {0}}, {"right", 0, 2, {0}}, {"end", 0, 1, {1, 2}}})},
      workers);
}

TEST(Shape, IsThatOfTheDag) {
  const TaskSet task_set = compiled(fork_and_join(2));
  const Shape shape(task_set, task_set.units[0], 2);
  // Going back from the end: the join, the longer branch alone for two, both branches for two, the fork.
  const Duration left[] = {0, 1, 2, 3, 5, 7, 8, 8, 8};
  // Two paths, of 6 and of 2.
  const Duration done[] = {0, 2, 4, 5, 6, 7, 8, 8, 8};
  for (Duration time = 0; time < 9; ++time) {
    EXPECT_EQ(shape.left(time), left[time]) << time;
    EXPECT_EQ(shape.done(time), done[time]) << time;
  }
}

TEST(Shape, OneWorkerDoesOneThingAtATime) {
  const TaskSet task_set = compiled(fork_and_join(1));
  const Shape shape(task_set, task_set.units[0], 1);
  for (Duration time = 0; time < 12; ++time) {
    EXPECT_EQ(shape.left(time), std::min<Duration>(time, 8));
    EXPECT_EQ(shape.done(time), std::min<Duration>(time, 8));
  }
}

// One task, then `parallel` tasks side by side, then one more: wider than the workers.
Workload wide(std::uint32_t parallel, Duration wcet, std::uint32_t workers) {
  std::vector<testing::TestTask> tasks = {{"begin", 20, 2}};
  std::vector<std::uint32_t> all;
  for (std::uint32_t i = 1; i <= parallel; ++i) {
    tasks.push_back({"t" + std::to_string(i), 0, wcet + i % 3, {0}});
    all.push_back(i);
  }
  tasks.push_back({"end", 0, 1, all});
  return make_workload({tick_dag("wide", tasks)}, workers);
}

// Compares both functions with their definitions, instant by instant.
void expect_shape_is_right(const TaskSet &task_set, const Unit &unit, std::uint32_t m) {
  std::map<std::uint32_t, std::pair<Duration, Duration>> times;  // as early as possible
  for (const std::uint32_t t : unit.tasks) {
    Duration start = 0;
    for (const std::uint32_t p : task_set.tasks[t].predecessors) start = std::max(start, times[p].second);
    times[t] = {start, start + task_set.tasks[t].wcet};
  }
  const std::vector<Duration> paths = disjoint_paths(task_set, unit, unit.tasks.size(), Heaviest::MostTasks);
  const Shape shape(task_set, unit, m);
  for (Duration time = 0; time <= unit.volume + 1; ++time) {
    const Duration cut = m * time;
    Duration left = 0;
    for (const auto &[task, span] : times) {
      left += std::max<Duration>(0, span.second - std::max(span.first, unit.length - time));
    }
    Duration done = 0;
    for (const Duration path : paths) done += std::min(path, time);
    ASSERT_EQ(shape.left(time), std::min(cut, left)) << "left at " << time << " of " << unit.length << ", m " << m;
    ASSERT_EQ(shape.done(time), std::min(cut, done)) << "done in " << time << ", m " << m;
  }
}

TEST(Shape, IsWhatItSaysAtEveryInstant) {
  for (const std::uint32_t workers : {1U, 2U, 3U, 4U}) {
    for (std::uint32_t parallel = 1; parallel < 10; ++parallel) {
      for (const Duration wcet : {1, 2, 5}) {
        const TaskSet task_set = compiled(wide(parallel, wcet, workers));
        expect_shape_is_right(task_set, task_set.units[0], workers);
      }
    }
  }
  for_cases(cases(graphs()), 300, [&](const testing::BoundCase &bound_case, const TaskSet &task_set, Rng &) {
    for (const Unit &unit : task_set.units) expect_shape_is_right(task_set, unit, bound_case.platform.workers);
  });
}

// Placements of the first job where slopes change suffice: they give the same as all placements.
TEST(Shape, WorkIsTheMostOverAllPlacements) {
  std::uint64_t checked = 0;
  std::uint64_t single = 0;
  for_cases(cases(graphs()), 400, [&](const testing::BoundCase &bound_case, const TaskSet &task_set, Rng &rng) {
    for (const Unit &unit : task_set.units) {
      single += unit.tasks.size() == 1 ? 1U : 0U;
      const std::uint32_t m = bound_case.platform.workers;
      const Shape shape(task_set, unit, m);
      const Duration least = unit.length + (unit.volume - unit.length) / m;
      if (least > unit.period) continue;
      const Duration response = rng.uniform(least, unit.period);
      for (const Duration x : {rng.uniform(1, unit.period), rng.uniform(1, 4 * unit.period)}) {
        Duration most = 0;
        for (Duration first = 1; first <= unit.period; ++first) {
          Duration sum = std::min(shape.left(first), shape.done(x));
          for (Duration rest = x + response - first - unit.period; rest > 0; rest -= unit.period) {
            sum += shape.done(rest);
          }
          most = std::max(most, sum);
        }
        ASSERT_EQ(shape.work(x, response, unit.period), most) << x << " " << response;
        ++checked;
      }
    }
  });
  EXPECT_GT(checked, 500U);
  EXPECT_GT(single, 50U);
}

// Neither bound is always the smaller: dag_bounded() limits each DAG's work to its width while a path waits.
TEST(DagShapes, AndWidthsAreIncomparable) {
  std::uint64_t smaller = 0;
  std::uint64_t larger = 0;
  for_cases(cases(graphs()), 3000, [&](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
    const Outcome bounded = dag_bounded().apply(task_set);
    const Outcome shapes = dag_shapes().apply(task_set);
    if (!std::holds_alternative<Bound>(shapes)) return;
    for (std::size_t d = 0; d < task_set.dags.size(); ++d) {
      const Duration one = std::get<Bound>(shapes).dags[d].response.value_or(kNever);
      const Duration other = std::get<Bound>(bounded).dags[d].response.value_or(kNever);
      smaller += one < other ? 1U : 0U;
      larger += one > other ? 1U : 0U;
    }
  });
  EXPECT_GT(smaller, 0U);
  EXPECT_GT(larger, 0U);
}

TEST(DagShapes, MoreExecutionNeverShrinksABound) {
  std::uint64_t compared = 0;
  for_cases(cases(graphs()), 1500, [&](const testing::BoundCase &bound_case, const TaskSet &task_set, Rng &rng) {
    const Outcome before = dag_shapes().apply(task_set);
    if (!std::holds_alternative<Bound>(before)) return;
    Workload more = bound_case.workload;
    Dag &dag = more.dags[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(more.dags.size()) - 1))];
    ++dag.tasks[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(dag.tasks.size()) - 1))].wcet;
    const auto larger = compile(more, bound_case.platform);
    if (!larger) return;  // above its deadline
    const Outcome after = dag_shapes().apply(*larger);
    for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
      const Duration grown = std::get<Bound>(after).tasks[t].response.value_or(kNever);
      ASSERT_LE(std::get<Bound>(before).tasks[t].response.value_or(kNever), grown);
    }
    ++compared;
  });
  EXPECT_GT(compared, 500U);
}

TEST(DagShapes, TermsAddUp) {
  for_cases(cases(graphs()), 1000, [](const testing::BoundCase &, const TaskSet &task_set, Rng &) {
    const Outcome outcome = dag_shapes().apply(task_set);
    if (!std::holds_alternative<Bound>(outcome)) return;
    for (const ResponseBound &bound : std::get<Bound>(outcome).dags) {
      Duration sum = 0;
      for (const Term &term : bound.terms) sum += term.amount;
      ASSERT_EQ(sum, bound.response.value_or(0));
    }
  });
}

}  // namespace
}  // namespace redag::analysis
