// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/sim/simulator.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "redag/derived/rng.hpp"

#include "redag/sched/priority_scheduler.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::sim {
namespace {

using redag::testing::make_dag;
using redag::testing::make_workload;
using redag::testing::simulate_events;
using redag::testing::timeline;
constexpr Duration kMs = kMillisecond;

// Liu & Layland, JACM 20(1), 1973: after simultaneous releases (the critical instant) the response of the lowest
// priority is largest. Periods 4, 6, 12; C 1, 2, 3: R3 = 3 + ceil(10/4) 1 + ceil(10/6) 2 = 10.
TEST(GoldenSchedule, CriticalInstantOfRateMonotonic) {
  const Workload workload =
      make_workload({make_dag("a", {{"t1", 4, 1}}), make_dag("b", {{"t2", 6, 2}}), make_dag("c", {{"t3", 12, 3}})}, 1,
                    PreemptionMode::Os);
  EXPECT_EQ(timeline(workload, simulate_events(workload, 12 * kMs)),
            "t1#0 w0 0-1\n"
            "t2#0 w0 1-3\n"
            "t3#0 w0 3-4 w0 5-6 w0 9-10\n"
            "t1#1 w0 4-5\n"
            "t2#1 w0 6-8\n"
            "t1#2 w0 8-9\n");
}

TEST(GoldenSchedule, WithoutPreemptionALongJobBlocks) {
  const Workload workload = make_workload({make_dag("a", {{"hi", 4, 1, {}, "", 1}}), make_dag("b", {{"lo", 20, 6}})}, 1,
                                          PreemptionMode::None);
  EXPECT_EQ(timeline(workload, simulate_events(workload, 10 * kMs)),
            "lo#0 w0 0-6\n"
            "hi#1 w0 6-7\n"
            "hi#2 w0 9-10\n"
            "hi#0 skipped overrun 5\n");
}

// Dhall & Liu, Operations Research 26(1), 1978: m light tasks of high rate and a heavy one. At U barely above 1 the
// heavy one misses although m - 1 processors are nearly idle. m = 2: two (C=1, T=10), one (C=11, T=11).
TEST(GoldenSchedule, DhallEffect) {
  const Workload workload = make_workload(
      {make_dag("a", {{"l1", 10, 1}, {"l2", 10, 1}}), make_dag("b", {{"heavy", 11, 11}})}, 2, PreemptionMode::Os);
  const std::vector<JobEvent> events = simulate_events(workload, 11 * kMs);
  EXPECT_EQ(timeline(workload, events),
            "l1#0 w0 0-1\n"
            "l2#0 w1 0-1\n"
            "heavy#0 w0 1-10 w0 11-\n"
            "l1#1 w1 10-11\n"
            "l2#1 w0 10-11\n");
}

TEST(Simulator, RecordsNoEventsWithoutASink) {
  const Workload workload = make_workload({make_dag("a", {{"t1", 4, 1}, {"t2", 6, 2}}), make_dag("b", {{"t3", 12, 5}})},
                                          2, PreemptionMode::Os);
  sched::PriorityScheduler heard(workload, sched::config_of(workload));
  sched::PriorityScheduler silent(workload, sched::config_of(workload));
  Options options;
  options.horizon = 100 * kMs;
  const Result with = simulate(workload, heard, 2, options, [](std::span<const JobEvent>) { return true; });
  const Result without = simulate(workload, silent, 2, options, {});
  EXPECT_EQ(with.released, without.released);
  EXPECT_EQ(with.finished, without.finished);
  EXPECT_EQ(with.end, without.end);
  for (std::uint32_t t = 0; t < 3; ++t) EXPECT_EQ(heard.accounting(TaskId(t)), silent.accounting(TaskId(t)));
  silent.release(TaskId(0), options.horizon, options.horizon);
  EXPECT_TRUE(silent.dispatch(options.horizon).events.empty());
}

// Graham, SIAM J. Appl. Math. 17(2), 1969: with list scheduling, shorter jobs can make the schedule longer. Nine tasks
// on three workers, t1 -> t9, t4 -> {t5, t6, t7, t8}; C = 3 2 2 2 4 4 4 4 9: length 12; each C less by one: 13.
class GrahamAnomaly : public ::testing::Test {
 protected:
  static Time length(Duration less) {
    const std::vector<Duration> times = {3, 2, 2, 2, 4, 4, 4, 4, 9};
    std::vector<redag::testing::TestTask> tasks;
    for (std::size_t i = 0; i < times.size(); ++i) {
      tasks.push_back({"t" + std::to_string(i + 1), i < 4 ? 100 : 0, times[i] - less});
    }
    for (std::size_t i = 4; i < 8; ++i) tasks[i].after = {3};
    tasks[8].after = {0};
    Dag dag = make_dag("graham", tasks);
    Workload workload = make_workload({dag}, 3, PreemptionMode::None, PolicyKind::Fixed);
    for (std::size_t i = 0; i < times.size(); ++i) workload.dags[0].tasks[i].priority = 9 - static_cast<int>(i);
    Time last = 0;
    for (const JobEvent &event : simulate_events(workload, 100 * kMs)) {
      if (event.kind == JobEventKind::Finished) last = event.time;
    }
    return last / kMs;
  }
};

TEST_F(GrahamAnomaly, ShorterJobsMakeALongerSchedule) {
  EXPECT_EQ(length(0), 12);
  EXPECT_EQ(length(1), 13);
}

TEST(GoldenSchedule, CapDefersAndDelaysNobodyElse) {
  const Workload workload = make_workload({make_dag("capped", {{"a", 20, 3}, {"b", 20, 3}, {"c", 20, 3}}, 1),
                                           make_dag("free", {{"d", 40, 2}, {"e", 40, 2}})},
                                          3, PreemptionMode::None);
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMs)),
            "a#0 w0 0-3\n"
            "d#0 w1 0-2\n"
            "e#0 w2 0-2\n"
            "b#0 w0 3-6\n"
            "c#0 w0 6-9\n");
}

TEST(GoldenSchedule, CapCountsPreemptedJobs) {
  const Workload workload = make_workload({make_dag("capped", {{"slow", 100, 6}, {"fast", 50, 1, {}, "", 2}}, 1),
                                           make_dag("other", {{"mid", 60, 2, {}, "", 1}})},
                                          1, PreemptionMode::Os);
  // `fast` is more urgent than both, but `slow`, which `mid` preempts, has the only place of its DAG.
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMs)),
            "slow#0 w0 0-1 w0 3-8\n"
            "mid#0 w0 1-3\n"
            "fast#0 w0 8-9\n");
}

TEST(GoldenSchedule, GroupBlocksAndInheritsPriority) {
  const Workload workload =
      make_workload({make_dag("a", {{"hi", 50, 1, {}, "bus", 2}}), make_dag("b", {{"mid", 60, 4, {}, "", 3}}),
                     make_dag("c", {{"lo", 100, 5, {}, "bus"}})},
                    1, PreemptionMode::Os);
  // From 2 on `lo` runs at `hi`'s priority; `mid` thus cannot delay `hi` through it.
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMs)),
            "lo#0 w0 0-5\n"
            "hi#0 w0 5-6\n"
            "mid#0 w0 6-10\n");
}

TEST(GoldenSchedule, PreemptedHolderResumesWhenPriorityIsInherited) {
  const Workload workload =
      make_workload({make_dag("a", {{"hi", 50, 1, {}, "bus", 2}}), make_dag("b", {{"mid", 60, 4, {}, "", 1}}),
                     make_dag("c", {{"lo", 100, 5, {}, "bus"}})},
                    1, PreemptionMode::Os);
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMs)),
            "lo#0 w0 0-1 w0 2-6\n"
            "mid#0 w0 1-2 w0 7-10\n"
            "hi#0 w0 6-7\n");
}

TEST(GoldenSchedule, DataTasksFollowTheirPredecessors) {
  const Workload workload = make_workload(
      {make_dag("chain", {{"source", 10, 2}, {"left", 0, 1, {0}}, {"right", 0, 3, {0}}, {"join", 0, 1, {1, 2}}})}, 2);
  EXPECT_EQ(timeline(workload, simulate_events(workload, 10 * kMs)),
            "source#0 w0 0-2\n"
            "left#0 w0 2-3\n"
            "right#0 w1 2-5\n"
            "join#0 w0 5-6\n");
}

TEST(GoldenSchedule, TimerTaskWaitsForFreshDataOfASlowerPredecessor) {
  const Workload workload = make_workload({make_dag("g", {{"slow", 20, 1}, {"fast", 10, 1, {0}}})}, 1);
  EXPECT_EQ(timeline(workload, simulate_events(workload, 40 * kMs)),
            "slow#0 w0 0-1\n"
            "fast#0 w0 1-2\n"
            "slow#1 w0 20-21\n"
            "fast#2 w0 21-22\n"
            "fast#1 skipped precedence 20\n");
}

TEST(GoldenSchedule, CooperativeJobsGiveWayAtTheirRegions) {
  Workload workload = make_workload({make_dag("a", {{"hi", 50, 2, {}, "", 1}}), make_dag("b", {{"lo", 100, 10}})}, 1,
                                    PreemptionMode::Cooperative);
  workload.dags[1].tasks[0].region = 4 * kMs;
  EXPECT_EQ(timeline(workload, simulate_events(workload, 20 * kMs)),
            "lo#0 w0 0-4 w0 6-12\n"
            "hi#0 w0 4-6\n");
}

TEST(GoldenSchedule, QueueKeepsReleasesUpToItsDepth) {
  Workload workload = make_workload({make_dag("a", {{"t", 10, 25}})}, 1);
  workload.dags[0].tasks[0].overrun = Overrun::Queue;
  workload.dags[0].tasks[0].queue_depth = 1;
  EXPECT_EQ(timeline(workload, simulate_events(workload, 49 * kMs)),
            "t#0 w0 0-25\n"
            "t#1 w0 25-\n"
            "t#2 skipped queue_full 20\n"
            "t#4 skipped queue_full 40\n");
}

TEST(GoldenSchedule, BudgetCutsAJobOff) {
  Workload workload = make_workload({make_dag("a", {{"source", 10, 4}, {"sink", 0, 1, {0}}})}, 1);
  workload.dags[0].tasks[0].budget = 3 * kMs;
  EXPECT_EQ(timeline(workload, simulate_events(workload, 10 * kMs)),
            "source#0 w0 0-3\n"
            "source#0 aborted budget 3\n");
}

std::uint64_t finished(const std::vector<JobEvent> &events, TaskId task) {
  return static_cast<std::uint64_t>(std::count_if(events.begin(), events.end(), [task](const JobEvent &event) {
    return event.kind == JobEventKind::Finished && event.task == task;
  }));
}

// rclcpp#2912: two timers of 20 ms, one whose body takes 25 ms and one that takes almost no time. In a fixed order the
// second one never runs. Of simultaneous releases the heavy one goes first, as it does in the file.
TEST(EqualRates, ALightTimerGetsItsTurnBesideAHeavyOne) {
  Workload workload = make_workload({make_dag("a", {{"heavy", 20, 25}}), make_dag("b", {{"light", 20}})}, 1);
  workload.dags[1].tasks[0].wcet = workload.dags[1].tasks[0].bcet = kMicrosecond;
  std::vector<JobEvent> events = simulate_events(workload, 5'000 * kMs);
  EXPECT_EQ(finished(events, TaskId(0)), 199U);
  EXPECT_EQ(finished(events, TaskId(1)), 100U);
  workload.ties = Ties::Fixed;
  events = simulate_events(workload, 5'000 * kMs);
  EXPECT_EQ(finished(events, TaskId(0)), 200U);
  EXPECT_EQ(finished(events, TaskId(1)), 0U);
}

// rclcpp#2360: two timers of 100 ms in one mutually exclusive group; each body takes longer than the period.
TEST(EqualRates, TimersOfOneGroupTakeTurns) {
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Os}) {
    for (const std::uint32_t workers : {1U, 2U}) {
      Workload workload =
          make_workload({make_dag("a", {{"one", 100, 203, {}, "g"}, {"two", 100, 203, {}, "g"}})}, workers, mode);
      std::vector<JobEvent> events = simulate_events(workload, 10'000 * kMs);
      EXPECT_EQ(finished(events, TaskId(0)), 25U);
      EXPECT_EQ(finished(events, TaskId(1)), 24U);
      workload.ties = Ties::Fixed;
      events = simulate_events(workload, 10'000 * kMs);
      EXPECT_EQ(finished(events, TaskId(0)), 49U);
      EXPECT_EQ(finished(events, TaskId(1)), 0U);
    }
  }
}

// A chain goes on before the timer's next job, which would otherwise delay each of its tasks by a period.
TEST(EqualRates, AChainTakesTurnsWithATimer) {
  const Workload workload =
      make_workload({make_dag("a", {{"heavy", 20, 25}}), make_dag("b", {{"source", 20}, {"sink", 0, 1, {0}}})}, 1);
  const std::vector<JobEvent> events = simulate_events(workload, 2'000 * kMs);
  for (const std::uint32_t task : {0U, 1U, 2U}) EXPECT_GE(finished(events, TaskId(task)), 35U) << task;
}

// It stays on the stack of the worker that it began on. The second worker is free for 80 % of the time.
TEST(CooperativeJobs, CanLieUnderOthersForever) {
  Workload workload = make_workload(
      {make_dag("a", {{"beside", 10, 2, {}, "", 4}, {"whole", 10, 10, {}, "", 5}}), make_dag("b", {{"lo", 1000, 6}})},
      2, PreemptionMode::Cooperative);
  workload.dags[1].tasks[0].region = kMs;
  EXPECT_EQ(finished(simulate_events(workload, 10'000 * kMs), TaskId(2)), 0U);
  workload.platform.preemption = PreemptionMode::Os;
  EXPECT_EQ(finished(simulate_events(workload, 10'000 * kMs), TaskId(2)), 10U);
}

// The worker of a job depends on unrelated tasks; the data that another job reads must not.
class CompletionsOfOneInstant : public ::testing::Test {
 protected:
  // When q and p end together, x takes the data of both.
  static Dag joined() {
    return redag::testing::tick_dag(
        "d", {{"q", 4, 1}, {.name = "p", .period = 8, .wcet = 2, .offset = 3}, {"x", 0, 1, {1, 0}}});
  }

  static std::vector<Time> origins(const Workload &workload, TaskId task) {
    std::vector<Time> origins;
    for (const JobEvent &event : simulate_events(workload, 80)) {
      if (event.kind == JobEventKind::Ready && event.task == task) origins.push_back(event.value);
    }
    return origins;
  }
};

TEST_F(CompletionsOfOneInstant, AreToldInTheOrderOfTasks) {
  const Workload alone = make_workload({joined()}, 2);
  const std::vector<Time> origins_alone = origins(alone, TaskId(2));
  ASSERT_FALSE(origins_alone.empty());
  EXPECT_EQ(origins_alone.front(), 3) << "q, which comes first in its DAG, ended first: its second datum is there";
  const Dag unrelated = redag::testing::tick_dag("u", {{.name = "u", .period = 100, .wcet = 2, .offset = 2}});
  EXPECT_EQ(origins(make_workload({joined(), unrelated}, 2), TaskId(2)), origins_alone);
  EXPECT_EQ(origins(make_workload({unrelated, joined()}, 2), TaskId(3)), origins_alone);
}

// The order of the file is not that of the edges.
TEST_F(CompletionsOfOneInstant, AreToldInTopologicalOrderWithinADag) {
  const Workload workload = make_workload({make_dag("a", {{"last", 0, 2, {2}}, {"long", 10, 5}, {"first", 10, 3}})}, 2);
  std::vector<TaskId> ended;
  for (const JobEvent &event : simulate_events(workload, 9 * kMs)) {
    if (event.kind == JobEventKind::Finished && event.time == 5 * kMs) ended.push_back(event.task);
  }
  EXPECT_EQ(ended, (std::vector<TaskId>{TaskId(1), TaskId(0)}));
}

// With enough workers nothing is ever delayed, and added tasks do not change what any job reads.
TEST_F(CompletionsOfOneInstant, UnrelatedTasksChangeNoDataWhereNobodyWaits) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Rng rng(seed);
    Workload workload =
        redag::testing::random_workload(rng, {.max_dags = 2, .max_tasks = 5, .groups = false, .bounds = false});
    Workload more = workload;
    more.dags.push_back(
        redag::testing::random_dag(rng, {.max_dags = 1, .max_tasks = 4, .groups = false, .bounds = false}));
    more.dags.back().name = "unrelated";
    for (Workload *w : {&workload, &more}) {
      w->platform = Platform{40, PreemptionMode::None};
      for (Dag &dag : w->dags) dag.criticality = Criticality::Normal;
    }
    Options options;
    options.seed = seed;
    const auto of_first = [&](const Workload &w) {
      std::vector<JobEvent> kept;
      for (JobEvent event : simulate_events(w, 300 * kMicrosecond, options)) {
        event.worker = 0;
        if (event.task.value < workload.task_count()) kept.push_back(event);
      }
      return kept;
    };
    ASSERT_EQ(of_first(workload), of_first(more)) << "seed " << seed;
  }
}

TEST(Simulator, OverheadsLengthenJobs) {
  const Workload workload = make_workload({make_dag("a", {{"hi", 50, 2, {}, "", 1}}), make_dag("b", {{"lo", 100, 10}})},
                                          1, PreemptionMode::Os);
  Options options;
  options.overheads = {1 * kMs, 1 * kMs, 1 * kMs};
  EXPECT_EQ(timeline(workload, simulate_events(workload, 30 * kMs, options)),
            "lo#0 w0 0-1 w0 5-17\n"
            "hi#0 w0 1-5\n");
}

TEST(Simulator, SameSeedSameEvents) {
  Workload workload = make_workload({make_dag("a", {{"x", 7, 2}, {"y", 0, 3, {0}}}, 1), make_dag("b", {{"z", 11, 4}})},
                                    2, PreemptionMode::Os);
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      task.bcet = task.wcet / 4;
      task.jitter = kMs / 2;
      task.execution.kind = ExecutionTime::Kind::Uniform;
    }
  }
  Options other_seed;
  other_seed.seed = 2;
  const auto first = simulate_events(workload, kSecond);
  EXPECT_EQ(first, simulate_events(workload, kSecond));
  EXPECT_NE(first, simulate_events(workload, kSecond, other_seed));
}

TEST(Simulator, SinkCanEndIt) {
  const Workload workload = make_workload({make_dag("a", {{"x", 1, 1}})}, 1);
  sched::PriorityScheduler scheduler(workload, sched::config_of(workload));
  const Result result = simulate(workload, scheduler, 1, {}, [](auto events) { return events.front().time < 5 * kMs; });
  EXPECT_EQ(result.end, 5 * kMs);
}

TEST(Hyperperiod, IsTheLeastCommonMultipleOrNothing) {
  EXPECT_EQ(hyperperiod(make_workload({make_dag("a", {{"x", 4}, {"y", 6}})}, 1)), 12 * kMs);
  EXPECT_EQ(hyperperiod(make_workload({make_dag("a", {{"x", 4}, {"y", 6}})}, 1), 11 * kMs), std::nullopt);
}

}  // namespace
}  // namespace redag::sim
