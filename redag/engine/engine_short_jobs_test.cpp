// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the engine saves for jobs that are over within CpuMeter::kShort, without any visible difference.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/cpu_meter.hpp"
#include "redag/threads/threads.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/every_mode.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;

constexpr int kEnoughShortJobs = 200;  // eight in a row suffice, but a loaded machine interrupts some

// An engine for independent tasks on one worker; the first one is the most urgent.
class ShortJobs : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (mode() == PreemptionMode::Os && band_.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  }
  static PreemptionMode mode() { return GetParam(); }

  void start(std::vector<Body> bodies, std::uint32_t workers = 1) {
    Workload workload = redag::testing::ladder(bodies.size());
    for (Task &task : workload.dags[0].tasks) task.priority = -*task.priority;
    EngineOptions options;
    options.config = make_config(Mode{mode(), {}}, workers, workload.policy, band_, 4);
    options.band = band_;
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine_->bind(workload, std::move(bodies));
    ASSERT_TRUE(engine_->start());
    engine_->set_origin(monotonic_now());
  }

  void run(std::size_t task, int times = 1) {
    for (int i = 0; i < times; ++i) {
      const std::uint64_t before = finished(task);
      engine_->release(TaskId(task), engine_->now());
      while (finished(task) == before) std::this_thread::yield();
    }
  }

  std::uint64_t finished(std::size_t task) const { return engine_->figures(TaskId(task)).jobs.finished; }

  const PriorityBand band_ = probe_priority_band();
  std::unique_ptr<Engine> engine_;
};
INSTANTIATE_TEST_SUITE_P(Modes, ShortJobs, testing::every_mode(), testing::mode_name);

TEST_P(ShortJobs, OneThatSleepsAllTheSameIsNotChargedForIt) {
  std::atomic<bool> sleeps{false};
  start({[&](const Job &) {
    if (sleeps) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    return Outcome::Finished;
  }});
  run(0, kEnoughShortJobs);
  sleeps = true;
  run(0, 3);
  EXPECT_LT(engine_->figures(TaskId(0)).usage.longest, 25 * kMillisecond);
}

TEST_P(ShortJobs, OneThatComputesAllTheSameIsChargedForIt) {
  std::atomic<Duration> demand{0};
  start({[&](const Job &) {
    const Duration begun = thread_cpu_now();
    while (thread_cpu_now() - begun < demand) {
    }
    if (demand > 0) {
      EXPECT_GE(job_cpu_time(), demand);
    }
    return Outcome::Finished;
  }});
  run(0, kEnoughShortJobs);
  EXPECT_GT(engine_->figures(TaskId(0)).usage.total, 0);
  demand = 2 * kMillisecond;
  run(0);
  EXPECT_GE(engine_->figures(TaskId(0)).usage.longest, demand);
  EXPECT_LT(engine_->figures(TaskId(0)).usage.longest, 100 * demand);
}

TEST_P(ShortJobs, AJobIsNotChargedForTheOneBefore) {
  const auto use = [](Duration demand) {
    const Duration begun = thread_cpu_now();
    while (thread_cpu_now() - begun < demand) {
    }
    return Outcome::Finished;
  };
  start({[&](const Job &) { return use(20 * kMillisecond); }, [&](const Job &) { return use(100 * kMicrosecond); }});
  const Release both[] = {{TaskId(0), engine_->now()}, {TaskId(1), engine_->now()}};
  engine_->release(both);
  while (finished(1) == 0) std::this_thread::yield();
  EXPECT_GE(engine_->figures(TaskId(0)).usage.longest, 20 * kMillisecond);
  EXPECT_GE(engine_->figures(TaskId(1)).usage.longest, 100 * kMicrosecond);
  EXPECT_LT(engine_->figures(TaskId(1)).usage.longest, 10 * kMillisecond);
}

// What a body releases shortly before its end is left to its own thread. If it goes on all the same, another worker
// takes the job meanwhile.
TEST_P(ShortJobs, WhatAJobReleasesStartsBesideItIfItGoesOn) {
  int left = 2000;
  std::atomic<std::int64_t> latest{-1};
  std::atomic<bool> seen{false};
  std::atomic<bool> ended{false};
  const auto release = [&](std::size_t task) { engine_->release(TaskId(task), engine_->now()); };
  const auto first = [&](const Job &) {
    release(1);
    if (--left > 0) {
      release(0);
      return Outcome::Finished;
    }
    const auto last = static_cast<std::int64_t>(engine_->figures(TaskId(1)).jobs.released) - 1;
    for (int ms = 0; ms < 10'000 && latest < last; ++ms) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    seen = latest == last;
    ended = true;
    return Outcome::Finished;
  };
  const auto second = [&](const Job &job) {
    latest = static_cast<std::int64_t>(job.number);
    return Outcome::Finished;
  };
  start({first, second}, 2);
  release(0);
  while (!ended) std::this_thread::yield();
  EXPECT_TRUE(seen);
}

// The same where nothing else ends a job meanwhile.
TEST_P(ShortJobs, WhatWaitsForTheEndOfItsSenderStartsIfThatGoesOn) {
  std::atomic<int> seen{0};
  std::atomic<bool> goes_on{false};
  const auto release_and_wait = [&](int ms) {
    const int before = seen;
    engine_->release(TaskId(1), engine_->now());
    for (int i = 0; i < ms && seen == before; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return seen > before;
  };
  const auto first = [&](const Job &) {
    if (!goes_on) {
      release_and_wait(0);
      return Outcome::Finished;
    }
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(release_and_wait(10'000));
    return Outcome::Finished;
  };
  const auto second = [&](const Job &) {
    ++seen;
    return Outcome::Finished;
  };
  start({first, second}, 2);
  run(0, kEnoughShortJobs);
  goes_on = true;
  run(0);
}

// Only `os` changes priorities.
class ShortJobsWithPriorities : public ShortJobs {};
INSTANTIATE_TEST_SUITE_P(Modes, ShortJobsWithPriorities, ::testing::Values(PreemptionMode::Os), testing::mode_name);

// The thread of job 2 keeps the priority of the job of 0 before it. A job of 1 lies in between, and must not wait for
// 2.
TEST_P(ShortJobsWithPriorities, AThreadThatKeptItsPriorityLosesItToAJobInBetween) {
  std::atomic<bool> waits{false};
  std::atomic<bool> seen{false};
  start({[](const Job &) { return Outcome::Finished; },
         [&](const Job &) {
           seen = true;
           return Outcome::Finished;
         },
         [&](const Job &) {
           if (!waits) return Outcome::Finished;
           engine_->release(TaskId(1), engine_->now());
           const Time give_up = monotonic_now() + 5 * kSecond;
           while (!seen && monotonic_now() < give_up) {
           }
           EXPECT_TRUE(seen);
           EXPECT_EQ(fifo_priority(pthread_self()), band_.of_level(2));
           return Outcome::Finished;
         }});
  run(2, kEnoughShortJobs);
  waits = true;
  run(0);
  run(2);
}

// The body reads its thread's priority. A short job keeps the priority of the job before; a longer one has its own.
TEST_P(ShortJobsWithPriorities, OnlyOneThatIsExpectedToBeShortKeepsAHigherPriority) {
  std::atomic<int> last{0};
  std::atomic<bool> is_long{true};
  start({[](const Job &) { return Outcome::Finished; },
         [&](const Job &) {
           last = fifo_priority(pthread_self());
           const Time end = monotonic_now() + (is_long ? 2 * CpuMeter::kShort : 0);
           while (monotonic_now() < end) {
           }
           return Outcome::Finished;
         }});
  run(1);
  run(0);
  run(1);
  EXPECT_EQ(last, band_.of_level(1));
  is_long = false;
  // On a shared machine, jobs take longer now and then.
  for (const Time limit = monotonic_now() + 60 * kSecond; last == band_.of_level(1) && monotonic_now() < limit;) {
    run(1, 10);
    run(0);
    run(1);
  }
  EXPECT_EQ(last, band_.of_level(0));
}

}  // namespace
}  // namespace redag::runtime
