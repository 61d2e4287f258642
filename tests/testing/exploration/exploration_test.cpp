// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The exploration on task sets that can be solved by hand; exploration_property_test.cpp compares it with the
// scheduler.
#include "tests/testing/exploration/exploration.hpp"

#include <gtest/gtest.h>

#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::compiled;

testing::TestTask timer(const char *name, Duration bcet, Duration wcet, Duration period, Duration jitter = 0,
                        Time offset = 0) {
  return {.name = name, .period = period, .wcet = wcet, .offset = offset, .bcet = bcet, .jitter = jitter};
}

BoundCase one_dag(std::uint32_t workers, const std::vector<testing::TestTask> &tasks, std::uint32_t max_active = 0) {
  BoundCase result;
  result.platform.workers = workers;
  result.platform.preemption = sched::Preemption::None;
  result.workload.dags = {testing::tick_dag("d", tasks, max_active)};
  return result;
}

// The short execution of `a` lets `b` start before `c` arrives: an anomaly that the worst case of each job misses.
TEST(Exploration, FindsAnomalies) {
  const BoundCase bound_case = one_dag(1, {timer("a", 2, 3, 20), timer("c", 4, 4, 20, 0, 3), timer("b", 9, 9, 40)});
  const TaskSet task_set = compiled(bound_case);
  const Exploration exploration = explore(task_set);
  ASSERT_EQ(exploration.end, Exploration::End::Complete);
  // a takes 3: c from 3 to 7, b from 7 to 16. a takes 2: b from 2 to 11, c from 11 to 15.
  EXPECT_EQ(exploration.responses[1][0], (ResponseRange{4, 12}));
  EXPECT_EQ(exploration.responses[2][0], (ResponseRange{11, 16}));
  EXPECT_EQ(exploration.responses[1][1], (ResponseRange{4, 4})) << "no b then";
  EXPECT_EQ(exploration.hyperperiod, 40);
  EXPECT_EQ(exploration.jobs, 5U);
}

TEST(Exploration, HoldsMaxActiveAndGroups) {
  const std::vector<testing::TestTask> tasks = {timer("a", 3, 3, 20), timer("b", 3, 3, 20), timer("c", 3, 3, 20)};
  const auto worst = [](const BoundCase &bound_case) {
    const TaskSet task_set = compiled(bound_case);
    const Exploration exploration = explore(task_set);
    return exploration.of(TaskId(2)).worst;
  };
  EXPECT_EQ(worst(one_dag(3, tasks)), 3);
  EXPECT_EQ(worst(one_dag(3, tasks, 2)), 6);
  EXPECT_EQ(worst(one_dag(3, tasks, 1)), 9);
  BoundCase grouped = one_dag(3, tasks);
  grouped.workload.dags[0].tasks[0].group = grouped.workload.dags[0].tasks[2].group = "g";
  EXPECT_EQ(worst(grouped), 6);
}

// With offsets beyond the hyperperiod, the differences of a second hyperperiod are found, too.
TEST(Exploration, FollowsUntilItRepeats) {
  const BoundCase bound_case = one_dag(1, {timer("a", 2, 2, 10, 0, 25), timer("b", 4, 4, 10)});
  const TaskSet task_set = compiled(bound_case);
  const Exploration exploration = explore(task_set);
  ASSERT_EQ(exploration.end, Exploration::End::Complete);
  EXPECT_GT(exploration.hyperperiods, 1U);
  EXPECT_EQ(exploration.of(TaskId(0)), (ResponseRange{2, 2}));
  EXPECT_EQ(exploration.of(TaskId(1)), (ResponseRange{4, 4}));
  const Exploration later = explore(compiled(one_dag(1, {timer("a", 2, 2, 10, 0, 21), timer("b", 4, 4, 10)})));
  EXPECT_EQ(later.of(TaskId(0)), (ResponseRange{5, 5})) << "b holds the worker when a comes";
}

TEST(Exploration, SaysWhenItEndsEarly) {
  const BoundCase bound_case = one_dag(2, {timer("a", 1, 6, 20, 5), timer("b", 1, 6, 30, 5), timer("c", 1, 6, 70, 5)});
  const TaskSet task_set = compiled(bound_case);
  const Exploration complete = explore(task_set);
  ASSERT_EQ(complete.end, Exploration::End::Complete);
  ASSERT_GT(complete.states, 10U);

  EXPECT_EQ(explore(task_set, complete.states).end, Exploration::End::Complete);
  EXPECT_EQ(explore(task_set, complete.states - 1).end, Exploration::End::GaveUp);
  const Exploration at_once = explore(task_set, 10);
  EXPECT_EQ(at_once.end, Exploration::End::GaveUp) << "fewer than the jobs of a hyperperiod";
  EXPECT_EQ(at_once.states, 0U);
  EXPECT_EQ(at_once.jobs, 41U);

  const TaskSet late = compiled(one_dag(1, {timer("a", 1, 9, 20, 5), timer("b", 1, 12, 30)}));
  const Exploration overrun = explore(late);
  EXPECT_EQ(overrun.end, Exploration::End::Overrun);
  EXPECT_EQ(overrun.late, TaskId(0));
}

TEST(Exploration, SaysWhereThereIsNothingToExplore) {
  BoundCase bound_case = one_dag(1, {timer("a", 1, 2, 10)});
  EXPECT_FALSE(why_not_explore(compiled(bound_case)));
  for (const Phase phase : {Phase::Unknown, Phase::Event}) {
    BoundCase free = one_dag(1, {timer("a", 1, 2, 10), timer("b", 1, 2, 10)});
    free.workload.dags[0].tasks[1].phase = phase;
    EXPECT_EQ(why_not_explore(compiled(free)),
              "nothing states when some tasks are released after others: they have no common clock");
  }
  BoundCase event = bound_case;
  event.workload.dags[0].tasks[0].phase = Phase::Event;
  EXPECT_TRUE(why_not_explore(compiled(event))) << "it need not be periodic";
  bound_case.workload.policy = PolicyKind::Fifo;
  EXPECT_TRUE(why_not_explore(compiled(bound_case)));
  bound_case.workload.policy = PolicyKind::Edf;
  EXPECT_FALSE(why_not_explore(compiled(bound_case)));
  bound_case.workload.dags = {testing::tick_dag("d", {timer("a", 1, 2, 10), {"b", 0, 1, {0}}})};
  EXPECT_TRUE(why_not_explore(compiled(bound_case)));
  bound_case.workload.policy = PolicyKind::RateMonotonic;
  EXPECT_FALSE(why_not_explore(compiled(bound_case)));
  bound_case.platform.preemption = sched::Preemption::Full;
  EXPECT_TRUE(why_not_explore(compiled(bound_case)));
  bound_case.platform.preemption = sched::Preemption::Cooperative;
  EXPECT_FALSE(why_not_explore(compiled(bound_case))) << "no region: the same as none";
  const Duration third = kMaxDuration / 3;
  bound_case = one_dag(1, {timer("a", 1, 2, third), timer("b", 1, 2, third - 1)});
  EXPECT_TRUE(why_not_explore(compiled(bound_case)));
}

}  // namespace
}  // namespace redag::analysis
