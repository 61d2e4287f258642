// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// In `os` mode the kernel also schedules preempted jobs. Each started job's SCHED_FIFO priority must follow its level
// at every decision, running or suspended. The bodies wait instead of computing; no result depends on time.
#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;
using testing::make_dag;

// A job whose body waits until it is told to end.
struct HeldJob {
  Event begun;
  Event may_end;
  pthread_t thread{};

  Body body() {
    return [this](const Job &) {
      thread = pthread_self();
      begun.set();
      may_end.wait();
      return Outcome::Finished;
    };
  }
  [[nodiscard]] int priority() const { return fifo_priority(thread); }
};

// An engine with one worker: of two jobs in progress, the less urgent one is suspended.
class EngineLevels : public ::testing::Test {
 protected:
  void SetUp() override {
    if (band_.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO: " << realtime_hint();
  }

  void start(std::vector<Dag> dags, std::vector<Body> bodies) {
    Workload workload;
    workload.dags = std::move(dags);
    EngineOptions options;
    options.config = make_config(Mode{PreemptionMode::Os, {}}, 1, workload.policy, band_, 8);
    options.band = band_;
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine_->bind(workload, std::move(bodies));
    ASSERT_TRUE(engine_->start());
    engine_->set_origin(monotonic_now());
  }
  void begin(std::size_t task, HeldJob &job) {
    engine_->release(TaskId(task), engine_->now());
    job.begun.wait();
  }
  void finish() {
    engine_->halt();
    ASSERT_TRUE(engine_->wait_idle(kNever));
    engine_->join();
    EXPECT_TRUE(engine_->problems().empty());
  }

  const PriorityBand band_ = probe_priority_band();
  HeldJob slow_;
  HeldJob fast_;
  std::unique_ptr<Engine> engine_;
};

TEST_F(EngineLevels, AddedTasksKeepTheOrderOfSuspendedAndRunningJobs) {
  start({make_dag("slow", {{"t", 100}}), make_dag("fast", {{"t", 50}})}, {slow_.body(), fast_.body()});
  begin(0, slow_);
  begin(1, fast_);
  EXPECT_EQ(fast_.priority(), band_.of_level(0));
  EXPECT_EQ(slow_.priority(), band_.of_level(1));
  const Body nothing = [](const Job &) { return Outcome::Finished; };
  engine_->add_dag(make_dag("added", {{"t", 1}, {"u", 2}}), {nothing, nothing});
  engine_->release(TaskId(2), engine_->now());  // the decision at which the levels change
  EXPECT_EQ(fast_.priority(), band_.of_level(2));
  EXPECT_EQ(slow_.priority(), band_.of_level(3));
  fast_.may_end.set();
  slow_.may_end.set();
  finish();
}

TEST_F(EngineLevels, AnotherPeriodReordersASuspendedJob) {
  start({make_dag("d", {{"slow", 100}, {"middle", 70}, {"fast", 50}})},
        {slow_.body(), [](const Job &) { return Outcome::Finished; }, fast_.body()});
  begin(0, slow_);
  begin(2, fast_);
  EXPECT_EQ(slow_.priority(), band_.of_level(2));
  engine_->set_timing(TaskId(0), 60 * kMillisecond, 60 * kMillisecond);
  engine_->release(TaskId(1), engine_->now());
  EXPECT_EQ(slow_.priority(), band_.of_level(1));
  EXPECT_EQ(fast_.priority(), band_.of_level(0));
  fast_.may_end.set();
  slow_.may_end.set();
  finish();
}

TEST_F(EngineLevels, HighModeLowersASuspendedJobOfLowerCriticality) {
  Dag overrunning = make_dag("overrunning", {{"t", 5, 5}});
  Dag critical = make_dag("critical", {{"t", 100}});
  overrunning.criticality = critical.criticality = Criticality::High;
  overrunning.tasks[0].wcet_low = 100 * kMicrosecond;
  int lowered_to = 0;
  start({make_dag("low", {{"t", 10}}), overrunning, critical}, {slow_.body(),
                                                                [&](const Job &) {
                                                                  const Duration used_before = thread_cpu_now();
                                                                  while (thread_cpu_now() - used_before < kMillisecond)
                                                                    preemption_point();
                                                                  lowered_to = slow_.priority();
                                                                  fast_.begun.set();
                                                                  return Outcome::Finished;
                                                                },
                                                                [](const Job &) { return Outcome::Finished; }});
  begin(0, slow_);
  EXPECT_EQ(slow_.priority(), band_.of_level(1));
  begin(1, fast_);
  EXPECT_EQ(lowered_to, band_.of_level(band_.levels())) << "below every job of high criticality";
  slow_.may_end.set();
  finish();
}

}  // namespace
}  // namespace redag::runtime
