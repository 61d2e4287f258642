// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies that wait: what a job's coroutine may count on, on real threads. No test depends on how long anything takes:
// where an order matters, jobs wait for events that other jobs set.
#include "redag/engine/coroutine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <latch>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/runtime/executor.hpp"
#include "tests/testing/allocation_counter.hpp"
#include "tests/testing/every_mode.hpp"
#include "tests/testing/one_worker.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::once;
using testing::one_worker;
using testing::one_worker_and_gpu;

using EveryMode = testing::InEveryMode;

INSTANTIATE_TEST_SUITE_P(Coroutines, EveryMode, testing::every_mode(), testing::mode_name);

// The only worker would otherwise be held for ever.
TEST_P(EveryMode, TheWorkerRunsAnotherJobMeanwhile) {
  Executor executor(one_worker(mode()));
  AsyncEvent answer;
  std::vector<std::string> order;
  executor.add(once("client", [&]() -> Coroutine {
    order.emplace_back("asks");
    co_await answer;
    order.emplace_back("answered");
    executor.stop();
  }));
  DagBuilder server("server");
  server.timer("task", 1h,
               [&] {
                 order.emplace_back("answers");
                 answer.set();
               },
               {.offset = 1ms});
  executor.add(std::move(server));
  executor.run();
  EXPECT_EQ(order, (std::vector<std::string>{"asks", "answers", "answered"}));
}

// The thread of the program finds the only worker idle. Whoever is woken first has it.
TEST(Coroutine, OfThoseThatWaitForAnEventTheMostUrgentGoesOnFirst) {
  ExecutorOptions options = one_worker();
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  AsyncEvent event;
  AsyncEvent other;
  std::latch all_wait(1);
  std::vector<int> order;
  const auto waits_for = [&](AsyncEvent &its_event, int priority) {
    executor.add(once("waits_" + std::to_string(priority),
                      [&, priority]() -> Coroutine {
                        co_await its_event;
                        order.push_back(priority);
                        if (order.size() == 4) executor.stop();
                      },
                      {.priority = priority}));
  };
  waits_for(event, 4);
  waits_for(other, 5);
  waits_for(event, 3);
  waits_for(other, 2);
  const DagId last = executor.add(once("last", [&] { all_wait.count_down(); }, {.priority = 1}));
  executor.start();
  all_wait.wait();
  while (executor.stats(last)[0].jobs.finished == 0) std::this_thread::yield();
  AsyncEvent::set_all(std::array{&event, &other});
  executor.wait();
  EXPECT_EQ(order, (std::vector<int>{5, 4, 3, 2}));
}

// "For ever" is no time in the past.
TEST(Coroutine, ASleepWithoutEndIsEndedByTheStop) {
  Executor executor(one_worker());
  bool went_on = false;
  bool cancelled = false;
  executor.add(once("sleeps", [&]() -> Coroutine {
    try {
      co_await sleep_for(nanoseconds::max());
      went_on = true;
    } catch (const WaitCancelled &) {
      cancelled = true;
      throw;
    }
  }));
  executor.add(once("later", [&] { executor.stop(); }, {.offset = 5ms}));
  executor.run();
  EXPECT_FALSE(went_on);
  EXPECT_TRUE(cancelled);
}

TEST_P(EveryMode, AThreadOfTheProgramSetsAnEvent) {
  Executor executor(one_worker(mode()));
  AsyncEvent requested;
  AsyncEvent delivered;
  constexpr int kRounds = 300;
  int rounds = 0;
  executor.add(once("client", [&]() -> Coroutine {
    while (rounds < kRounds) {
      requested.set();
      co_await delivered;
      ++rounds;
    }
    executor.stop();
  }));
  std::atomic<bool> done{false};
  std::thread sensor([&] {
    while (!done) {
      if (requested.take()) delivered.set();
      std::this_thread::yield();
    }
  });
  executor.run();
  done = true;
  sensor.join();
  EXPECT_EQ(rounds, kRounds);
}

TEST_P(EveryMode, ASleepEndsNotBeforeItsTime) {
  Executor executor(one_worker(mode()));
  executor.add(once("sleeper", [&]() -> Coroutine {
    for (const auto length : {3ms, 1ms, 0ms, -1ms}) {
      const auto until = std::chrono::steady_clock::now() + length;
      co_await sleep_until(until);
      EXPECT_GE(std::chrono::steady_clock::now(), until);
    }
    const auto before = std::chrono::steady_clock::now();
    co_await sleep_for(2ms);
    EXPECT_GE(std::chrono::steady_clock::now(), before + 2ms);
    executor.stop();
  }));
  executor.run();
}

TEST_P(EveryMode, AllSleepersWakeAndNoneEarly) {
  constexpr int kSleepers = 20;
  Executor executor(one_worker(mode()));
  std::atomic<int> woken{0};
  for (int i = 0; i < kSleepers; ++i) {
    executor.add(once("sleeper_" + std::to_string(i), [&, i]() -> Coroutine {
      const auto until = std::chrono::steady_clock::now() + (7 * i % kSleepers) * 1ms;
      co_await sleep_until(until);
      EXPECT_GE(std::chrono::steady_clock::now(), until);
      if (++woken == kSleepers) executor.stop();
    }));
  }
  executor.run();
  EXPECT_EQ(woken.load(), kSleepers);
}

// Both jobs wait before the event that wakes them: the less urgent one asked first.
TEST(Coroutine, AWokenJobKeepsItsPlaceInTheOrderOfJobs) {
  ExecutorOptions options = one_worker();
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  AsyncEvent go;
  std::vector<int> order;
  int waiting = 0;
  for (const int priority : {1, 3, 2}) {
    executor.add(once("client_" + std::to_string(priority),
                      [&, priority]() -> Coroutine {
                        ++waiting;
                        co_await go;
                        order.push_back(priority);
                        if (order.size() == 3) executor.stop();
                      },
                      {.priority = priority}));
  }
  DagBuilder setter("setter");
  setter.timer("task", 1h,
               [&] {
                 EXPECT_EQ(waiting, 3);
                 go.set();  // wakes all while the only worker is taken
               },
               {.offset = 2ms, .priority = 0});
  executor.add(std::move(setter));
  executor.run();
  EXPECT_EQ(order, (std::vector<int>{3, 2, 1}));
}

Coroutine inner(int depth, std::vector<int> &order) {
  order.push_back(depth);
  co_await sleep_for(100us);
  if (depth > 0) co_await inner(depth - 1, order);
  order.push_back(depth);
  if (depth == 0) throw std::runtime_error("of the innermost");
}

TEST(Coroutine, AwaitsOthersLikeFunctions) {
  Executor executor(one_worker());
  std::vector<int> order;
  executor.add(once("outer", [&]() -> Coroutine {
    bool caught = false;
    try {
      co_await inner(2, order);
    } catch (const std::runtime_error &) {
      caught = true;
    }
    EXPECT_TRUE(caught);
    executor.stop();
  }));
  executor.run();
  EXPECT_EQ(order, (std::vector<int>{2, 1, 0, 0}));
}

// Spins until the job has used that much processor time.
void use(nanoseconds time) {
  while (job_cpu_time() < time.count()) {
  }
}

TEST_P(EveryMode, ProcessorTimeCountsAcrossWaitsAndWaitsDoNot) {
  ExecutorOptions options = one_worker(mode());
  Executor executor(options);
  const DagId dag = executor.add(once("job", [&]() -> Coroutine {
    use(2ms);
    co_await sleep_for(20ms);
    EXPECT_GE(job_cpu_time(), (2ms / 1ns));
    use(4ms);
    co_await sleep_for(20ms);
    executor.stop();
  }));
  executor.run();
  const TaskStats stats = executor.stats(dag)[0];
  EXPECT_EQ(stats.usage.jobs, 1U);
  EXPECT_GE(stats.usage.total, (4ms / 1ns));
}

TEST_P(EveryMode, AJobThatHasUsedItsBudgetIsCutOffWhereItWouldWait) {
  Executor executor(one_worker(mode()));
  const auto alive = std::make_shared<bool>();  // copied into each frame: a body's locals are not lost
  std::atomic<bool> went_on{false};
  DagBuilder dag("dag");
  dag.timer("task", 20ms,
            [&]() -> Coroutine {
              const std::shared_ptr<void> local(alive);
              use(2ms);
              co_await sleep_for(1ms);
              use(4ms);  // more than the budget only together with what it used before
              co_await sleep_for(1h);
              went_on = true;
            },
            {.budget = 3ms});
  const DagId id = executor.add(std::move(dag));
  executor.start();
  while (executor.stats(id)[0].jobs.aborted < 2) std::this_thread::sleep_for(1ms);
  executor.stop();
  EXPECT_FALSE(went_on);
  EXPECT_EQ(alive.use_count(), 1);
}

TEST(Coroutine, APreemptionPointCutsOffAfterAWait) {
  Executor executor(one_worker());
  std::atomic<bool> went_on{false};
  DagBuilder dag("dag");
  dag.timer("task", 20ms,
            [&]() -> Coroutine {
              use(2ms);
              co_await sleep_for(1ms);
              use(4ms);
              preemption_point();
              went_on = true;
            },
            {.budget = 3ms});
  const DagId id = executor.add(std::move(dag));
  executor.start();
  while (executor.stats(id)[0].jobs.aborted < 1) std::this_thread::sleep_for(1ms);
  executor.stop();
  EXPECT_FALSE(went_on);
}

// The urgent job runs on top of the other one at its preemption point. It leaves the worker to it when it waits, and
// comes back on top at another preemption point.
TEST(Coroutine, CooperativelyAWaitOnTopGoesBackToTheJobBelow) {
  ExecutorOptions options = one_worker(PreemptionMode::Cooperative);
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  AsyncEvent device;
  std::atomic<int> stage{0};
  executor.add(once("below",
                    [&] {
                      while (stage < 1) preemption_point();
                      stage = 2;
                      device.set();
                      while (stage < 3) preemption_point();
                      executor.stop();
                    },
                    {.priority = 1}));
  executor.add(once("urgent",
                    [&]() -> Coroutine {
                      stage = 1;
                      co_await device;
                      EXPECT_EQ(stage.load(), 2);
                      stage = 3;
                    },
                    {.offset = 2ms, .priority = 2}));
  executor.run();
  EXPECT_EQ(stage.load(), 3);
}

TEST(Coroutine, AllJobsOfATaskCanWaitAtOnce) {
  Executor executor(one_worker());
  AsyncEvent go;
  std::atomic<int> waiting{0};
  std::atomic<int> ended{0};
  DagBuilder dag("dag");
  dag.timer("task", 1ms,
            [&]() -> Coroutine {
              if (++waiting == 3) go.set();
              if (waiting <= 3) co_await go;
              if (++ended == 3) executor.stop();
            },
            {.deadline = 1s, .concurrency = 3});
  executor.add(std::move(dag));
  executor.run();
  EXPECT_GE(ended.load(), 3);
}

TEST_P(EveryMode, ADagThatIsRemovedKeepsItsBodyUntilTheWaitIsOver) {
  Executor executor(one_worker(mode()));
  AsyncEvent go;
  AsyncEvent removed;
  auto owned = std::make_shared<int>(7);
  const std::weak_ptr<int> watch = owned;
  int value = 0;
  const DagId dag = executor.add(once("job", [&, owned = std::move(owned)]() -> Coroutine {
    go.set();
    co_await removed;
    value = *owned;
    go.set();
  }));
  executor.add(once("remover",
                    [&, dag]() -> Coroutine {
                      co_await go;
                      executor.remove(dag);
                      EXPECT_FALSE(watch.expired());
                      removed.set();
                      co_await go;
                      executor.stop();
                    },
                    {.offset = 1ms}));
  executor.run();
  EXPECT_EQ(value, 7);
  EXPECT_TRUE(watch.expired());
}

TEST(Coroutine, TheWatchdogReportsAJobThatWaitsForEver) {
  ExecutorOptions options = one_worker();
  options.watchdog = WatchdogOptions{.limits = {.longest = 5 * kMillisecond}, .interval = kMillisecond};
  AsyncEvent reported;
  std::string text;
  options.on_overdue = [&](const OverdueInfo &info) {
    text = info.text;
    reported.set();
  };
  Executor executor(options);
  executor.add(once("job", [&]() -> Coroutine {
    co_await reported;
    executor.stop();
  }));
  executor.run();
  EXPECT_NE(text.find("job.task #0 is overdue"), std::string::npos) << text;
}

TEST(Coroutine, NothingAllocatesInSteadyState) {
  Executor executor(one_worker_and_gpu());
  const DeviceHandle gpu = executor.device("gpu");
  AsyncEvent event;
  int jobs = 0;
  std::uint64_t before = 0;
  std::uint64_t after = 0;
  DagBuilder dag("dag");
  dag.timer("task", 1ms, [&]() -> Coroutine {
    if (++jobs == 20) before = testing::allocation_count();
    if (jobs == 60) {
      after = testing::allocation_count();
      executor.stop();
      co_return;
    }
    co_await sleep_for(10us);
    co_await gpu.run([&] { event.set(); });
    co_await event;
  });
  executor.add(std::move(dag));
  executor.run();
  EXPECT_EQ(after, before);
}

}  // namespace
}  // namespace redag::runtime
