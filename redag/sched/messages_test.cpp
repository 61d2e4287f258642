// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Data tasks with messages: tasks that were added alone, and whose predecessors come and go.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "redag/derived/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "tests/testing/builders.hpp"

namespace redag::sched {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Two sources, `a` and `b`, and `joined`, which has messages.
class Messages : public ::testing::Test {
 protected:
  void SetUp() override {
    Task joined = testing::tick_task({.period = 100, .deadline = 100});
    a = add(testing::tick_task({.period = 100, .deadline = 100}));
    b = add(testing::tick_task({.period = 100, .deadline = 100}));
    joined.activation = Activation::Data;
    join = add(joined);
    wait_for({a, b});
  }
  TaskId add(const Task &task) { return scheduler.add_task(dag, 0, task, now); }
  void wait_for(const std::vector<TaskId> &tasks) { scheduler.set_predecessors(join, tasks, ++now); }
  void send(TaskId sender = TaskId()) {
    ++now;
    scheduler.receive(join, sender, now, now, now);
  }
  void release(TaskId task) {
    ++now;
    scheduler.release(task, now, now);
  }
  JobSlot begin(TaskId task) {
    starts();
    release(task);
    return starts().front();
  }
  void end(JobSlot job, Outcome outcome = Outcome::Finished) { scheduler.complete(job, ++now, outcome); }
  void execute(TaskId task, Outcome outcome = Outcome::Finished) { end(begin(task), outcome); }
  // The jobs that start now.
  std::vector<JobSlot> starts() {
    std::vector<JobSlot> jobs;
    releases.clear();
    const Step step = scheduler.dispatch(now);
    for (const JobEvent &event : step.events) {
      if (event.kind == JobEventKind::Released && event.task == join) releases.push_back(event.value);
    }
    for (const Dispatch &dispatch : step.dispatches) {
      if (dispatch.kind == DispatchKind::Start) jobs.push_back(dispatch.job);
    }
    return jobs;
  }
  std::uint64_t released() { return scheduler.accounting(join).released; }

  Time now = 0;
  PriorityScheduler scheduler{Workload{}, Config{4, Preemption::Full, PolicyKind::RateMonotonic, 0, 0}};
  DagId dag = scheduler.add_dag(Dag{}, 0);
  TaskId a;
  TaskId b;
  TaskId join;
  std::vector<Time> releases;
};

TEST_F(Messages, AJobIsReleasedByTheLastOfItsMessageAndItsPredecessors) {
  send();
  execute(a);
  EXPECT_EQ(released(), 0U);
  execute(b);
  const Time end = now;
  EXPECT_EQ(starts().size(), 1U);
  EXPECT_THAT(releases, ElementsAre(end));

  execute(a);
  execute(b);
  EXPECT_EQ(released(), 1U);
  send();
  EXPECT_EQ(released(), 2U);
}

TEST_F(Messages, ANewerMessageReplacesTheOneThatWaits) {
  send();
  send();
  execute(a);
  send();
  execute(b);
  EXPECT_EQ(released(), 1U);
  execute(a);
  execute(b);
  EXPECT_EQ(released(), 1U);
}

TEST_F(Messages, AMessageWaitsForTheEndOfItsSender) {
  execute(a);  // sends nothing
  execute(b);
  const JobSlot sender = begin(a);
  send(a);
  EXPECT_EQ(released(), 0U);
  end(sender);
  EXPECT_EQ(released(), 1U);
}

TEST_F(Messages, AnAbortedSenderReleasesNothing) {
  execute(b);
  const JobSlot sender = begin(a);
  send(a);
  end(sender, Outcome::Threw);
  EXPECT_EQ(released(), 0U);
  execute(a);
  EXPECT_EQ(released(), 1U);
}

// The message came before the job's release and was told afterwards: the job has taken it.
TEST_F(Messages, AMessageThatAJobHasTakenDoesNotCountAgain) {
  send();
  execute(a);
  const Time arrived = ++now;
  execute(b);
  scheduler.receive(join, TaskId(), arrived, ++now, arrived);
  execute(a);
  execute(b);
  EXPECT_EQ(released(), 1U);
}

TEST_F(Messages, PredecessorsComeAndGo) {
  send();
  execute(a);
  wait_for({a});
  EXPECT_EQ(released(), 1U) << "b was all that it waited for";
  wait_for({});
  send();
  EXPECT_EQ(released(), 2U);
  wait_for({a, b});
  send();
  execute(b);
  scheduler.remove_task(a, ++now);
  EXPECT_EQ(released(), 2U);
  wait_for({b});
  EXPECT_EQ(released(), 3U);
}

TEST_F(Messages, ATimerTaskIsReleasedAtOnceWhenItsLastPredecessorLeaves) {
  const TaskId timer = add(testing::tick_task({.period = 100, .deadline = 100}));
  scheduler.set_predecessors(timer, std::vector{a}, ++now);
  release(timer);
  EXPECT_THAT(starts(), IsEmpty());
  scheduler.set_predecessors(timer, {}, ++now);
  EXPECT_EQ(starts().size(), 1U);
}

// Timers of the same period are not aligned: each has a clock of its own.
TEST_F(Messages, EdgesOfTasksAddedAloneAreNotAligned) {
  const TaskId timer = add(testing::tick_task({.period = 100, .deadline = 100}));
  scheduler.set_predecessors(timer, std::vector{a}, ++now);
  execute(a);
  release(timer);
  EXPECT_EQ(starts().size(), 1U);
}

// A second account of the rules, for random calls.
TEST_F(Messages, ReleasesAreThoseOfTheRules) {
  constexpr int kCalls = 200'000;
  Rng rng(11);
  bool fresh_a = false;
  bool fresh_b = false;
  bool message = false;
  std::uint64_t expected = 0;
  const auto decide = [&] {
    if (!fresh_a || !fresh_b || !message) return;
    ++expected;
    fresh_a = fresh_b = message = false;
  };
  for (int call = 0; call < kCalls; ++call) {
    switch (rng.uniform(0, 3)) {
      case 0:
        execute(a);
        fresh_a = true;
        break;
      case 1:
        execute(b);
        fresh_b = true;
        break;
      case 2:
        send();
        message = true;
        break;
      default: {
        const JobSlot sender = begin(b);
        send(b);
        message = true;
        fresh_b = false;
        decide();
        end(sender);
        fresh_b = true;
      }
    }
    decide();
    for (const JobSlot job : starts()) end(job);
    ASSERT_EQ(released(), expected) << "after call " << call;
  }
  EXPECT_GT(expected, 10'000U);
}

}  // namespace
}  // namespace redag::sched
