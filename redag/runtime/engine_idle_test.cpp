// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A thread without a job that waits for the next release: the leader (Engine::share_releases).
#include <gtest/gtest.h>
#include <pthread.h>

#include <atomic>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "redag/runtime/clock.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_testing/builders.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;

// An engine for some tasks. The release thread calls `on_expire` and is called again each millisecond.
class Leader : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (mode() == PreemptionMode::Os && band.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  }
  static PreemptionMode mode() { return GetParam(); }

  void start(std::uint32_t workers, Body body, bool realtime = false) {
    const Workload workload = testing::ladder(2);
    EngineOptions options;
    options.config = make_config(Mode{mode(), {}}, workers, workload.policy, band, workers);
    options.band = band;
    options.realtime_threads = realtime;
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine->bind(workload, {2, std::move(body)});
    engine->share_releases(releases);
    releases.release_due();  // a release is expected from here on
    ASSERT_TRUE(engine->start());
    engine->set_origin(monotonic_now());
  }
  void TearDown() override { end(); }
  /// Ends all threads. They use variables of the test, which calls this before these are gone.
  void end() {
    releases.stop();
    releases.join();
    if (engine) engine->join();
    engine.reset();
  }
  Time expire() {
    if (engine) on_expire();
    return monotonic_now() + kMillisecond;
  }
  void run_one_job() {
    const std::uint64_t before = engine->accounting(TaskId(1)).finished;
    engine->release(TaskId(1), engine->now());
    while (engine->accounting(TaskId(1)).finished == before) std::this_thread::yield();
  }

  const PriorityBand band = probe_priority_band();
  std::function<void()> on_expire = [] {};
  std::unique_ptr<Engine> engine;
  ReleaseThread releases{[this] { return expire(); }};
};

INSTANTIATE_TEST_SUITE_P(Modes, Leader,
                         ::testing::Values(PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Os),
                         [](const auto &instance) { return std::string(to_string(instance.param)); });

// The release thread is not started: no other thread releases the job.
TEST_P(Leader, RunsTheJobThatItReleases) {
  for (const std::uint32_t workers : {1U, 2U}) {
    std::atomic<bool> due{false};
    std::atomic<std::thread::id> releaser;
    std::atomic<std::thread::id> runner;
    on_expire = [&] {
      if (!due.exchange(false)) return;
      releaser = std::this_thread::get_id();
      engine->release(TaskId(0), engine->now());
    };
    start(workers, [&](const Job &job) {
      if (job.task == TaskId(0)) runner = std::this_thread::get_id();
      return Outcome::Finished;
    });
    run_one_job();
    due = true;
    while (engine->accounting(TaskId(0)).finished == 0) std::this_thread::yield();
    EXPECT_EQ(releaser.load(), runner.load());
    end();
  }
}

// Jobs that others release wake a leader that waits for a time.
TEST_P(Leader, TakesOtherJobsMeanwhile) {
  std::atomic<bool> leads{false};
  on_expire = [&] { leads = true; };
  start(1, [](const Job &) { return Outcome::Finished; });
  run_one_job();
  while (!leads) std::this_thread::yield();
  run_one_job();
  run_one_job();
  end();
}

TEST_P(Leader, LeavesReleasesToTheThreadWhileItHasAJob) {
  std::atomic<bool> due{false};
  std::atomic<bool> released{false};
  on_expire = [&] {
    if (!due.exchange(false)) return;
    EXPECT_FALSE(engine->in_body());
    released = true;
  };
  start(1, [&](const Job &job) {
    if (job.task == TaskId(0)) {
      due = true;
      while (!released) std::this_thread::yield();
    }
    return Outcome::Finished;
  });
  ASSERT_TRUE(releases.start({"timer", mode() == PreemptionMode::Os ? band.timer : 0, {}}));
  run_one_job();
  engine->release(TaskId(0), engine->now());
  while (engine->accounting(TaskId(0)).finished == 0) std::this_thread::yield();
  end();
}

TEST_P(Leader, WaitsAboveAllJobsAndRunsItsOwnAtTheirLevel) {
  if (mode() != PreemptionMode::Os) GTEST_SKIP() << "ordinary threads";
  std::atomic<int> waits_at{-1};
  std::atomic<int> runs_at{-1};
  std::atomic<bool> due{false};
  on_expire = [&] {
    if (!due) return;
    waits_at = fifo_priority(pthread_self());
    due = false;
    engine->release(TaskId(0), engine->now());
  };
  start(1, [&](const Job &job) {
    if (job.task == TaskId(0)) runs_at = fifo_priority(pthread_self());
    return Outcome::Finished;
  });
  for (int i = 0; i < 20; ++i) run_one_job();  // short jobs: their threads may keep a priority of jobs
  for (std::uint64_t i = 0; i < 20; ++i) {
    due = true;
    while (engine->accounting(TaskId(0)).finished == i) std::this_thread::yield();
    EXPECT_EQ(waits_at, band.timer);
    EXPECT_GT(runs_at, 0);
    EXPECT_LE(runs_at, band.top_job);
  }
  end();
}

TEST_P(Leader, RealTimeThreadsOfOtherModesHaveNone) {
  if (band.top_job == 0 || mode() == PreemptionMode::Os) GTEST_SKIP() << "needs SCHED_FIFO, and a mode without it";
  std::atomic<bool> called{false};
  on_expire = [&] { called = true; };
  start(
      2, [](const Job &) { return Outcome::Finished; }, true);
  called = false;
  run_one_job();
  run_one_job();
  EXPECT_FALSE(called);
  end();
}

}  // namespace
}  // namespace redag::runtime
