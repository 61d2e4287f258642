// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests what the engine tells observers about started jobs and their threads.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <memory>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/blocking.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;
using testing::ladder;

// Task 1 is more urgent, and runs on top of task 0 on the only thread.
TEST(EngineStarted, AJobThatRunsOnTopOfAnotherIsTheLastOfItsThread) {
  const Workload workload = ladder(2);
  EngineOptions options;
  options.config.policy = workload.policy;
  options.config.preemption = sched::Preemption::Cooperative;
  Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  Event begun;
  Event goes_on;
  std::atomic<int> thread{0};
  engine.bind(workload, {[&](const Job &) {
                           thread = gettid();
                           engine.release(TaskId(1), engine.now());
                           preemption_point();
                           return Outcome::Finished;
                         },
                         [&](const Job &) {
                           begun.set();
                           goes_on.wait();
                           return Outcome::Finished;
                         }});
  std::vector<StartedJob> started(3);
  ASSERT_TRUE(engine.start());
  engine.set_origin(monotonic_now());
  engine.started(started);
  EXPECT_TRUE(started.empty());
  engine.release(TaskId(0), 0);
  begun.wait();
  engine.started(started);
  if (started.size() != 2) goes_on.set();
  ASSERT_EQ(started.size(), 2U);
  EXPECT_EQ(started[0].job.task, TaskId(0));
  EXPECT_FALSE(started[0].on_top);
  EXPECT_EQ(started[0].begun, kNever);
  EXPECT_EQ(started[1].job.task, TaskId(1));
  EXPECT_TRUE(started[1].on_top);
  EXPECT_EQ(started[1].thread, started[0].thread);
  EXPECT_EQ(started[1].thread_id, thread);
  EXPECT_GT(started[1].begun, 0);
  EXPECT_LE(started[1].begun, engine.now());

  // The thread waits in the body: its processor time stands still.
  const Duration cpu = started[1].thread_cpu;
  EXPECT_GT(cpu, 0);
  const auto is_constant = [&] {
    const Duration before = started[1].thread_cpu;
    engine.started(started);
    return started[1].thread_cpu == before;
  };
  while (!is_constant()) {
  }
  goes_on.set();
  engine.halt();
  EXPECT_TRUE(engine.wait_idle(kNever));
  engine.started(started);
  EXPECT_TRUE(started.empty());
  engine.join();
}

TEST(EngineStarted, AJobThatBlocksInAScopeIsOneOfThem) {
  const Workload workload = ladder(1);
  EngineOptions options;
  options.config.policy = workload.policy;
  options.spare_threads = 1;
  Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  Event blocks;
  Event goes_on;
  std::atomic<int> thread{0};
  engine.bind(workload, {[&](const Job &) {
                thread = gettid();
                const redag::Blocking scope;
                EXPECT_TRUE(scope.lends());
                blocks.set();
                goes_on.wait();
                return Outcome::Finished;
              }});
  ASSERT_TRUE(engine.start());
  engine.set_origin(monotonic_now());
  engine.release(TaskId(0), 0);
  blocks.wait();
  std::vector<StartedJob> started;
  engine.started(started);
  goes_on.set();
  engine.halt();
  EXPECT_TRUE(engine.wait_idle(kNever));
  ASSERT_EQ(started.size(), 1U);
  EXPECT_EQ(started[0].job.task, TaskId(0));
  EXPECT_TRUE(started[0].on_top);
  EXPECT_TRUE(started[0].lends);
  EXPECT_EQ(started[0].thread_id, thread);
  EXPECT_GT(started[0].begun, 0);
  engine.started(started);
  EXPECT_TRUE(started.empty());
  engine.join();
}

}  // namespace
}  // namespace redag::runtime
