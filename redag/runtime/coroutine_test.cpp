// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies that wait: what a job's coroutine may count on, on real threads. No test depends on how long anything takes:
// where an order matters, jobs wait for events that other jobs set.
#include "redag/runtime/coroutine.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/runtime/async_event.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/runtime/preemption_point.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_testing/allocation_counter.hpp"
#include "redag_testing/one_worker.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::once;
using testing::one_worker;

ExecutorOptions with_gpu(PreemptionMode mode = PreemptionMode::None) {
  ExecutorOptions options = one_worker(mode);
  options.devices = {{.name = "gpu"}};
  return options;
}

std::vector<JobEventKind> kinds_of(const std::vector<JobEvent> &events, TaskId task) {
  std::vector<JobEventKind> kinds;
  for (const JobEvent &event : events) {
    if (event.task == task) kinds.push_back(event.kind);
  }
  return kinds;
}

class EveryMode : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  // The mode that `os` becomes where there are no real-time rights is tested anyway.
  [[nodiscard]] static PreemptionMode mode() {
    return GetParam() == PreemptionMode::Os ? PreemptionMode::Auto : GetParam();
  }
};

INSTANTIATE_TEST_SUITE_P(Coroutines, EveryMode,
                         ::testing::Values(PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Os),
                         [](const auto &test) { return std::string(to_string(test.param)); });

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

TEST_P(EveryMode, ADeviceServesOneJobInEachSlot) {
  ExecutorOptions options = with_gpu(mode());
  options.devices[0].slots = 2;
  Executor executor(options);
  const DeviceHandle gpu = executor.device("gpu");
  std::atomic<int> inside{0};
  std::atomic<int> most{0};
  std::atomic<int> served{0};
  for (int i = 0; i < 5; ++i) {
    executor.add(once("client_" + std::to_string(i), [&]() -> Coroutine {
      for (int round = 0; round < 20; ++round) {
        co_await gpu.run([&] {
          const int now = ++inside;
          for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
          }
          std::this_thread::yield();
          --inside;
        });
      }
      if (++served == 5) executor.stop();
    }));
  }
  executor.run();
  EXPECT_EQ(served.load(), 5);
  EXPECT_LE(most.load(), 2);
  EXPECT_GE(most.load(), 1);
}

// The device is busy until three more jobs have asked, the least urgent first.
std::vector<int> order_of_service(PreemptionMode mode, Device::Queue queue) {
  ExecutorOptions options = with_gpu(mode);
  options.devices[0].queue = queue;
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  const DeviceHandle gpu = executor.device("gpu");
  std::vector<int> order;  // the device's thread alone writes it
  std::atomic<int> served{0};
  std::atomic<bool> all_asked{false};
  AsyncEvent turn[5];
  const auto client = [&](int priority, int asks_as) {
    return once("client_" + std::to_string(priority),
                [&, priority, asks_as]() -> Coroutine {
                  if (asks_as > 0) co_await turn[asks_as];
                  turn[asks_as + 1].set();
                  co_await gpu.run([&] {
                    while (!all_asked) std::this_thread::sleep_for(100us);
                    order.push_back(priority);
                    ++served;
                  });
                  if (served == 4) executor.stop();
                },
                {.priority = priority});
  };
  // The only worker goes on with it once nobody else is ready: the last client has asked.
  executor.add(once("watcher",
                    [&]() -> Coroutine {
                      co_await turn[4];
                      all_asked = true;
                    },
                    {.priority = 0}));
  executor.add(client(9, 0));
  executor.add(client(1, 1));
  executor.add(client(2, 2));
  executor.add(client(3, 3));
  executor.run();
  return order;
}

// What the device is to do can own something that cannot be copied.
TEST(Coroutine, AFunctionWithANameIsNotCopied) {
  Executor executor(with_gpu());
  const DeviceHandle gpu = executor.device("gpu");
  int value = 0;
  executor.add(once("job", [&]() -> Coroutine {
    const auto read = [&, owned = std::make_unique<int>(7)] { value += *owned; };
    co_await gpu.run(read);
    co_await gpu.run(read);
    executor.stop();
  }));
  executor.run();
  EXPECT_EQ(value, 14);
}

TEST(Coroutine, ADeviceServesTheMostUrgentJobFirst) {
  EXPECT_EQ(order_of_service(PreemptionMode::None, Device::Queue::Priority), (std::vector<int>{9, 3, 2, 1}));
}

TEST(Coroutine, ADeviceInOrderOfRequestsServesTheFirst) {
  EXPECT_EQ(order_of_service(PreemptionMode::None, Device::Queue::Fifo), (std::vector<int>{9, 1, 2, 3}));
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

TEST_P(EveryMode, ExceptionsOfTheBodyAndOfTheDeviceAreTheJobs) {
  ExecutorOptions options = with_gpu(mode());
  std::vector<std::string> seen;
  options.on_exception = [&](const ExceptionInfo &info) {
    try {
      std::rethrow_exception(info.exception);
    } catch (const std::exception &exception) {
      seen.emplace_back(exception.what());
    }
    return OnException::Continue;
  };
  Executor executor(options);
  const DeviceHandle gpu = executor.device("gpu");
  AsyncEvent next;
  const DagId before = executor.add(once("before", [&]() -> Coroutine {
    next.set();
    throw std::runtime_error("before a wait");
    co_return;
  }));
  executor.add(once("after",
                    [&]() -> Coroutine {
                      co_await next;
                      co_await sleep_for(1ms);
                      next.set();
                      throw std::runtime_error("after a wait");
                    },
                    {.offset = 5ms}));
  executor.add(once("device",
                    [&]() -> Coroutine {
                      co_await next;
                      bool caught = false;
                      try {
                        co_await gpu.run([] { throw std::runtime_error("caught"); });
                      } catch (const std::runtime_error &) {
                        caught = true;
                      }
                      EXPECT_TRUE(caught);
                      executor.stop();
                      co_await gpu.run([] { throw std::runtime_error("not reached: the executor stops"); });
                    },
                    {.offset = 200ms}));
  executor.run();
  ASSERT_EQ(seen.size(), 2U);
  EXPECT_EQ(seen[0], "before a wait");
  EXPECT_EQ(seen[1], "after a wait");
  EXPECT_EQ(executor.stats(before)[0].jobs.aborted, 1U);
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

// Destroyed with its frame: tells that a body's locals are not lost.
struct Sentinel {
  explicit Sentinel(std::atomic<int> &its_count) : count(its_count) { ++count; }
  ~Sentinel() { --count; }
  Sentinel(const Sentinel &) = delete;
  Sentinel &operator=(const Sentinel &) = delete;
  std::atomic<int> &count;
};

// At the stop, one job sleeps, one waits for an event, one is served and one queues behind it.
TEST_P(EveryMode, TheStopEndsWaits) {
  ExecutorOptions options = with_gpu(mode());
  options.workers = 2;
  bool any_exception = false;
  options.on_exception = [&](const ExceptionInfo &) {
    any_exception = true;
    return OnException::Continue;
  };
  options.on_deadline_miss = [&](const MissInfo &) { any_exception = true; };
  std::atomic<int> alive{0};
  std::atomic<int> waiting{0};
  std::atomic<bool> served{false};
  std::atomic<bool> queued{false};
  std::atomic<bool> serving{false};
  AsyncEvent never;
  std::vector<DagId> dags;
  {
    Executor executor(options);
    const DeviceHandle gpu = executor.device("gpu");
    dags.push_back(executor.add(once("sleeps", [&]() -> Coroutine {
      const Sentinel sentinel(alive);
      ++waiting;
      co_await sleep_for(1h);
      ADD_FAILURE() << "the sleep was not over";
    })));
    dags.push_back(executor.add(once("waits", [&]() -> Coroutine {
      const Sentinel sentinel(alive);
      ++waiting;
      try {
        co_await never;
      } catch (const WaitCancelled &) {
        EXPECT_TRUE(executor.stopping());
        throw;
      }
      ADD_FAILURE() << "the event was not set";
    })));
    dags.push_back(executor.add(once("is_served", [&]() -> Coroutine {
      const Sentinel sentinel(alive);
      ++waiting;
      co_await gpu.run([&] {
        serving = true;
        while (!executor.stopping()) std::this_thread::sleep_for(100us);
      });
      served = true;  // a service is never cut off
    })));
    dags.push_back(executor.add(once("queues", [&]() -> Coroutine {
      const Sentinel sentinel(alive);
      ++waiting;
      while (!serving) co_await sleep_for(100us);
      queued = true;
      co_await gpu.run([] { ADD_FAILURE() << "served after the stop"; });
    })));
    executor.start();
    while (waiting < 4 || !queued) std::this_thread::sleep_for(100us);
    std::this_thread::sleep_for(2ms);
    executor.stop();
    EXPECT_EQ(alive.load(), 0);
    EXPECT_TRUE(served.load());
    EXPECT_FALSE(any_exception);
    for (const DagId dag : dags) {
      const TaskStats stats = executor.stats(dag)[0];
      EXPECT_EQ(stats.jobs.aborted, 0U) << stats.task << " is in flight";
    }
    EXPECT_EQ(executor.stats(dags[2])[0].jobs.finished, 1U);
  }
}

TEST(Coroutine, ADeviceMayStopTheExecutor) {
  Executor executor(with_gpu());
  const DeviceHandle gpu = executor.device("gpu");
  bool ended = false;
  executor.add(once("job", [&]() -> Coroutine {
    co_await gpu.run([&] { executor.stop(); });
    ended = true;
  }));
  executor.run();
  EXPECT_TRUE(ended);
}

TEST(Coroutine, ADestructorWaitsForTheDevice) {
  std::atomic<bool> left{false};
  {
    Executor executor(with_gpu());
    const DeviceHandle gpu = executor.device("gpu");
    std::atomic<bool> serving{false};
    executor.add(once("job", [&]() -> Coroutine {
      co_await gpu.run([&] {
        serving = true;
        while (!executor.stopping()) std::this_thread::sleep_for(100us);
      });
      left = true;
    }));
    executor.start();
    while (!serving) std::this_thread::sleep_for(100us);
  }
  EXPECT_TRUE(left.load());
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
  std::atomic<int> alive{0};
  std::atomic<bool> went_on{false};
  DagBuilder dag("dag");
  dag.timer("task", 20ms,
            [&]() -> Coroutine {
              const Sentinel sentinel(alive);
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
  EXPECT_EQ(alive.load(), 0);
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
  Executor executor(with_gpu());
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

TEST_P(EveryMode, EventsSayWhenAJobWaited) {
  ExecutorOptions options = with_gpu(mode());
  options.trace_capacity = 1000;
  Executor executor(options);
  const DeviceHandle gpu = executor.device("gpu");
  DagBuilder dag("dag");
  const TaskHandle job = dag.timer("job", 1h, [&]() -> Coroutine {
    co_await gpu.run([] {});
    co_await sleep_for(1ms);
  });
  dag.data("end", {job}, [&] { executor.stop(); });
  executor.add(std::move(dag));
  executor.run();
  std::vector<JobEvent> events;
  executor.drain(events);
  using enum JobEventKind;
  EXPECT_EQ(kinds_of(events, TaskId(0)),
            (std::vector<JobEventKind>{Released, Ready, Dispatched, Started, Waits, Served, Woken, Resumed, Waits,
                                       Woken, Resumed, Executed, Finished}));
}

TEST_P(EveryMode, TheCheckerAcceptsARecordedRun) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("redag_waits_" + std::to_string(::getpid()));
  std::filesystem::remove_all(folder);
  {
    ExecutorOptions options = with_gpu(mode());
    options.workers = 2;
    options.record = folder.string();
    Executor executor(options);
    const DeviceHandle gpu = executor.device("gpu");
    DagBuilder camera("camera", {.max_active = 2});
    const TaskHandle grab = camera.timer("grab", 2ms, [] {});
    camera.data("detect", {grab}, [&]() -> Coroutine { co_await gpu.run([] { std::this_thread::sleep_for(300us); }); },
                {.group = "state"});
    executor.add(std::move(camera));
    DagBuilder control("control");
    int jobs = 0;
    control.timer("step", 1ms,
                  [&]() -> Coroutine {
                    co_await sleep_for(50us);
                    if (++jobs == 100) executor.stop();
                  },
                  {.group = "state"});
    executor.add(std::move(control));
    executor.run();
  }
  const Result<trace::Trace> trace = trace::read_trace((folder / "events.redag").string());
  ASSERT_TRUE(trace.has_value()) << to_string(trace.error());
  ASSERT_EQ(trace->info.workload.platform.devices.size(), 1U);
  EXPECT_EQ(trace->info.workload.platform.devices[0].name, "gpu");
  const Task &detect = trace->info.workload.dags[0].tasks[1];
  ASSERT_EQ(detect.waits.size(), 1U) << "measured, as its wcet is";
  EXPECT_GE(detect.waits[0].longest, 300 * kMicrosecond);
  EXPECT_TRUE(trace->info.workload.dags[0].tasks[0].waits.empty());
  const auto waits = std::count_if(trace->events.begin(), trace->events.end(),
                                   [](const JobEvent &event) { return event.kind == JobEventKind::Waits; });
  EXPECT_GE(waits, 100);
  const metrics::CheckReport report = metrics::check_trace(*trace, metrics::rules_for(trace->info));
  EXPECT_TRUE(report.ok()) << report.to_string();
  std::filesystem::remove_all(folder);
}

TEST(Coroutine, WrongDevicesAreRefused) {
  ExecutorOptions options = with_gpu();
  Executor other(options);
  Executor executor(options);
  EXPECT_THROW(static_cast<void>(executor.device("dla")), std::out_of_range);
  const DeviceHandle gpu = other.device("gpu");
  bool refused = false;
  executor.add(once("job", [&]() -> Coroutine {
    try {
      co_await gpu.run([] {});
    } catch (const std::logic_error &) {
      refused = true;
    }
    executor.stop();
  }));
  executor.run();
  EXPECT_TRUE(refused);

  options.devices.push_back({.name = "gpu"});
  EXPECT_THROW(Executor{options}, std::invalid_argument) << "two of one name";
  options.devices = {{.name = "gpu", .slots = 0}};
  EXPECT_THROW(Executor{options}, std::invalid_argument);
  options.devices = {{.name = ""}};
  EXPECT_THROW(Executor{options}, std::invalid_argument);
}

}  // namespace
}  // namespace redag::runtime
