// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Threads without a job: which of them wait for the next release themselves (EngineOptions::while_idle).
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "redag/runtime/clock.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_testing/builders.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;

constexpr Duration kLongEnough = 60 * kSecond;  // for what happens within milliseconds

// An engine for some tasks. Their body counts, sets an event, and waits for a number of jobs in progress.
class IdleThreads : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void start(PreemptionMode mode, std::uint32_t workers, std::function<Time()> while_idle, bool realtime = false) {
    const Workload workload = testing::ladder(tasks);
    const PriorityBand band = probe_priority_band();
    EngineOptions options;
    options.config = make_config(Mode{mode, {}}, workers, workload.policy, band, workers);
    options.band = band;
    options.realtime_threads = realtime;
    options.while_idle = std::move(while_idle);
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    std::vector<Body> bodies(tasks, [this](const Job &) {
      ++begun;
      ran.set();
      while (begun < tasks) std::this_thread::yield();
      return Outcome::Finished;
    });
    engine->bind(workload, std::move(bodies));
    ASSERT_TRUE(engine->start());
    engine->set_origin(monotonic_now());
  }

  bool runs_a_job() {
    engine->release(TaskId(0), 0);
    return ran.wait_until(monotonic_now() + kLongEnough);
  }

  std::size_t tasks = 1;
  std::atomic<std::size_t> begun{0};
  std::unique_ptr<Engine> engine;
  Event ran;
};

INSTANTIATE_TEST_SUITE_P(OrdinaryThreads, IdleThreads,
                         ::testing::Values(PreemptionMode::None, PreemptionMode::Cooperative));

// No other thread releases the job.
TEST_P(IdleThreads, ReleaseWhatIsDue) {
  std::atomic<bool> due{false};
  start(GetParam(), 2, [&] {
    if (due.exchange(false)) engine->release(TaskId(0), 0);
    return monotonic_now() + kMillisecond;
  });
  due = true;
  EXPECT_TRUE(ran.wait_until(monotonic_now() + kLongEnough));
  engine->join();
}

// Jobs that others release wake a thread that waits for a time.
TEST_P(IdleThreads, TakeOtherJobsMeanwhile) {
  std::atomic<int> waiting{0};
  start(GetParam(), 2, [&] {
    ++waiting;
    return monotonic_now() + 2 * kLongEnough;
  });
  while (waiting < 2) std::this_thread::yield();
  EXPECT_TRUE(runs_a_job());
  engine->join();
}

TEST_P(IdleThreads, TwoWaitForReleases) {
  constexpr std::size_t kCalls = 1000;
  tasks = 6;
  std::atomic<bool> all_ran{false};
  std::mutex lock;
  std::vector<std::thread::id> callers;  // of the latest calls since all threads had a job
  Event settled;
  start(GetParam(), 6, [&] {
    const std::lock_guard guard(lock);
    if (all_ran) callers.push_back(std::this_thread::get_id());
    if (callers.size() == kCalls) {
      if (std::set(callers.begin(), callers.end()).size() <= 2) settled.set();
      callers.clear();
    }
    return monotonic_now() + kMillisecond / 10;
  });
  for (std::uint32_t task = 0; task < tasks; ++task) engine->release(TaskId(task), 0);
  for (std::uint32_t task = 0; task < tasks; ++task) {
    while (engine->accounting(TaskId(task)).finished == 0) std::this_thread::yield();
  }
  all_ran = true;
  EXPECT_TRUE(settled.wait_until(monotonic_now() + kLongEnough));
  engine->join();
}

TEST_P(IdleThreads, TheOnlyOneDoesNotWaitForReleases) {
  std::atomic<bool> called{false};
  start(GetParam(), 1, [&] {
    called = true;
    return kNever;
  });
  EXPECT_TRUE(runs_a_job());
  engine->join();
  EXPECT_FALSE(called);
}

TEST_P(IdleThreads, RealTimeOnesLeaveReleasesToTheTimer) {
  if (probe_priority_band().top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  std::atomic<bool> called{false};
  start(
      GetParam(), 2,
      [&] {
        called = true;
        return kNever;
      },
      true);
  EXPECT_TRUE(runs_a_job());
  engine->join();
  EXPECT_FALSE(called);
}

}  // namespace
}  // namespace redag::runtime
