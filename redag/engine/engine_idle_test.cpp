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

#include "redag/engine/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/every_mode.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;

// An engine for some tasks. The release thread calls `on_expire_` and is called again each millisecond.
class Leader : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (mode() == PreemptionMode::Os && band_.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  }
  static PreemptionMode mode() { return GetParam(); }

  void start(std::uint32_t workers, const Body &body, bool realtime = false) {
    const Workload workload = testing::ladder(2);
    EngineOptions options;
    options.config = make_config(Mode{mode(), {}}, workers, workload.policy, band_, workers);
    options.band = band_;
    options.realtime_threads = realtime;
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine_->bind(workload, std::vector<Body>(2, body));
    engine_->share_releases(releases_);
    releases_.release_due();  // a release is expected from here on
    ASSERT_TRUE(engine_->start());
    engine_->set_origin(monotonic_now());
  }
  void TearDown() override { end(); }
  /// Ends all threads. They use variables of the test, which calls this before these are gone.
  void end() {
    releases_.stop();
    releases_.join();
    if (engine_) engine_->join();
    engine_.reset();
  }
  Time expire() {
    if (engine_) on_expire_();
    return monotonic_now() + kMillisecond;
  }
  void run_one_job() {
    const std::uint64_t before = engine_->figures(TaskId(1)).jobs.finished;
    engine_->release(TaskId(1), engine_->now());
    while (engine_->figures(TaskId(1)).jobs.finished == before) std::this_thread::yield();
  }

  const PriorityBand band_ = probe_priority_band();
  std::function<void()> on_expire_ = [] {};
  std::unique_ptr<Engine> engine_;
  ReleaseThread releases_{[this] { return expire(); }};
};

INSTANTIATE_TEST_SUITE_P(Modes, Leader, testing::every_mode(), testing::mode_name);

// The release thread is not started: no other thread releases the job.
TEST_P(Leader, RunsTheJobThatItReleases) {
  for (const std::uint32_t workers : {1U, 2U}) {
    std::atomic<bool> due{false};
    std::atomic<std::thread::id> releaser;
    std::atomic<std::thread::id> runner;
    on_expire_ = [&] {
      if (!due.exchange(false)) return;
      releaser = std::this_thread::get_id();
      engine_->release(TaskId(0), engine_->now());
    };
    start(workers, [&](const Job &job) {
      if (job.task == TaskId(0)) runner = std::this_thread::get_id();
      return Outcome::Finished;
    });
    run_one_job();
    due = true;
    while (engine_->figures(TaskId(0)).jobs.finished == 0) std::this_thread::yield();
    EXPECT_EQ(releaser.load(), runner.load());
    end();
  }
}

// Jobs that others release wake a leader that waits for a time.
TEST_P(Leader, TakesOtherJobsMeanwhile) {
  std::atomic<bool> leads{false};
  on_expire_ = [&] { leads = true; };
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
  on_expire_ = [&] {
    if (!due.exchange(false)) return;
    EXPECT_EQ(engine_->current_job(), nullptr);
    released = true;
  };
  start(1, [&](const Job &job) {
    if (job.task == TaskId(0)) {
      due = true;
      while (!released) std::this_thread::yield();
    }
    return Outcome::Finished;
  });
  ASSERT_TRUE(releases_.start({"timer", mode() == PreemptionMode::Os ? band_.timer : 0, {}}));
  run_one_job();
  engine_->release(TaskId(0), engine_->now());
  while (engine_->figures(TaskId(0)).jobs.finished == 0) std::this_thread::yield();
  end();
}

TEST_P(Leader, WaitsAboveAllJobsAndRunsItsOwnAtTheirLevel) {
  if (mode() != PreemptionMode::Os) GTEST_SKIP() << "ordinary threads";
  std::atomic<int> waits_at{-1};
  std::atomic<int> runs_at{-1};
  std::atomic<bool> due{false};
  on_expire_ = [&] {
    if (!due) return;
    waits_at = fifo_priority(pthread_self());
    due = false;
    engine_->release(TaskId(0), engine_->now());
  };
  start(1, [&](const Job &job) {
    if (job.task == TaskId(0)) runs_at = fifo_priority(pthread_self());
    return Outcome::Finished;
  });
  for (int i = 0; i < 20; ++i) run_one_job();  // short jobs: their threads may keep a priority of jobs
  for (std::uint64_t i = 0; i < 20; ++i) {
    due = true;
    while (engine_->figures(TaskId(0)).jobs.finished == i) std::this_thread::yield();
    EXPECT_EQ(waits_at, band_.timer);
    EXPECT_GT(runs_at, 0);
    EXPECT_LE(runs_at, band_.top_job);
  }
  end();
}

TEST_P(Leader, RealTimeThreadsOfOtherModesHaveNone) {
  if (band_.top_job == 0 || mode() == PreemptionMode::Os) GTEST_SKIP() << "needs SCHED_FIFO, and a mode without it";
  std::atomic<bool> called{false};
  on_expire_ = [&] { called = true; };
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
