// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Jobs that wait for devices, on real threads. No test depends on how long anything takes: where an order matters, jobs
// wait for events that other jobs set.
#include "redag/runtime/device_handle.hpp"

#include <gtest/gtest.h>
#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/coroutine.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/runtime/executor.hpp"
#include "tests/testing/every_mode.hpp"
#include "tests/testing/one_worker.hpp"
#include "tests/testing/recorded_run.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::once;
using testing::one_worker_and_gpu;
using DeviceInEveryMode = testing::InEveryMode;

INSTANTIATE_TEST_SUITE_P(, DeviceInEveryMode, testing::every_mode(), testing::mode_name);

// A driver may wait actively. It must not keep more urgent jobs from the processor.
TEST_P(DeviceInEveryMode, AServiceHasThePriorityOfItsJob) {
  Executor executor(one_worker_and_gpu(mode()));
  const DeviceHandle gpu = executor.device("gpu");
  int of_job = -1;
  int of_service = -2;
  executor.add(once("client", [&]() -> Coroutine {
    of_job = fifo_priority(::pthread_self());
    const auto look = [&] { of_service = fifo_priority(::pthread_self()); };
    co_await gpu.run(look);
    executor.stop();
  }));
  executor.run();
  EXPECT_EQ(of_service, of_job);
}

// A job queues for the device, and holds a group that a more urgent job comes to wait for meanwhile.
TEST_P(DeviceInEveryMode, AServiceHasThePriorityThatItsJobInherits) {
  Executor executor(one_worker_and_gpu(mode()));
  const DeviceHandle gpu = executor.device("gpu");
  std::atomic<bool> is_served{false};
  std::atomic<bool> may_end{false};
  std::atomic<int> of_service{-1};
  std::atomic<int> of_urgent{-2};
  DagBuilder dag("dag");
  const EventHandle first = dag.event("first", 3s, [&]() -> Coroutine {
    co_await gpu.run([&] {
      is_served = true;
      while (!may_end) std::this_thread::sleep_for(100us);
    });
  });
  const EventHandle low = dag.event(
      "low", 2s, [&]() -> Coroutine { co_await gpu.run([&] { of_service = fifo_priority(::pthread_self()); }); },
      {.group = "g"});
  const EventHandle urgent = dag.event("urgent", 1s,
                                       [&] {
                                         of_urgent = fifo_priority(::pthread_self());
                                         executor.stop();
                                       },
                                       {.group = "g"});
  executor.add(std::move(dag));
  executor.start();
  executor.release(first);
  while (!is_served) std::this_thread::sleep_for(100us);
  executor.release(low);
  std::this_thread::sleep_for(20ms);  // time to queue; else it inherits earlier
  executor.release(urgent);
  may_end = true;
  executor.wait();
  EXPECT_EQ(of_service, of_urgent);
}

TEST_P(DeviceInEveryMode, ADeviceServesOneJobInEachSlot) {
  ExecutorOptions options = one_worker_and_gpu(mode());
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
  ExecutorOptions options = one_worker_and_gpu(mode);
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
TEST(Device, AFunctionWithANameIsNotCopied) {
  Executor executor(one_worker_and_gpu());
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

TEST(Device, ADeviceServesTheMostUrgentJobFirst) {
  EXPECT_EQ(order_of_service(PreemptionMode::None, Device::Queue::Priority), (std::vector<int>{9, 3, 2, 1}));
}

TEST(Device, ADeviceInOrderOfRequestsServesTheFirst) {
  EXPECT_EQ(order_of_service(PreemptionMode::None, Device::Queue::Fifo), (std::vector<int>{9, 1, 2, 3}));
}

TEST_P(DeviceInEveryMode, ExceptionsOfTheBodyAndOfTheDeviceAreTheJobs) {
  ExecutorOptions options = one_worker_and_gpu(mode());
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

// At the stop, one job sleeps, one waits for an event, one is served and one queues behind it.
TEST_P(DeviceInEveryMode, TheStopEndsWaits) {
  ExecutorOptions options = one_worker_and_gpu(mode());
  options.workers = 2;
  bool any_exception = false;
  options.on_exception = [&](const ExceptionInfo &) {
    any_exception = true;
    return OnException::Continue;
  };
  options.on_deadline_miss = [&](const MissInfo &) { any_exception = true; };
  const auto alive = std::make_shared<bool>();  // copied into each frame: a body's locals are not lost
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
      const std::shared_ptr<void> local(alive);
      ++waiting;
      co_await sleep_for(1h);
      ADD_FAILURE() << "the sleep was not over";
    })));
    dags.push_back(executor.add(once("waits", [&]() -> Coroutine {
      const std::shared_ptr<void> local(alive);
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
      const std::shared_ptr<void> local(alive);
      ++waiting;
      co_await gpu.run([&] {
        serving = true;
        while (!executor.stopping()) std::this_thread::sleep_for(100us);
      });
      served = true;  // a service is never cut off
    })));
    dags.push_back(executor.add(once("queues", [&]() -> Coroutine {
      const std::shared_ptr<void> local(alive);
      ++waiting;
      while (!serving) co_await sleep_for(100us);
      queued = true;
      co_await gpu.run([] { ADD_FAILURE() << "served after the stop"; });
    })));
    executor.start();
    while (waiting < 4 || !queued) std::this_thread::sleep_for(100us);
    std::this_thread::sleep_for(2ms);
    executor.stop();
    EXPECT_EQ(alive.use_count(), 1);
    EXPECT_TRUE(served.load());
    EXPECT_FALSE(any_exception);
    for (const DagId dag : dags) {
      const TaskStats stats = executor.stats(dag)[0];
      EXPECT_EQ(stats.jobs.aborted, 0U) << stats.task << " is in flight";
    }
    EXPECT_EQ(executor.stats(dags[2])[0].jobs.finished, 1U);
  }
}

TEST(Device, ADeviceMayStopTheExecutor) {
  Executor executor(one_worker_and_gpu());
  const DeviceHandle gpu = executor.device("gpu");
  bool ended = false;
  executor.add(once("job", [&]() -> Coroutine {
    co_await gpu.run([&] { executor.stop(); });
    ended = true;
  }));
  executor.run();
  EXPECT_TRUE(ended);
}

TEST(Device, ADestructorWaitsForTheDevice) {
  std::atomic<bool> left{false};
  {
    Executor executor(one_worker_and_gpu());
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

TEST_P(DeviceInEveryMode, EventsSayWhenAJobWaited) {
  ExecutorOptions options = one_worker_and_gpu(mode());
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
  std::vector<JobEventKind> kinds;
  for (const JobEvent &event : events) {
    if (event.task == TaskId(0)) kinds.push_back(event.kind);
  }
  EXPECT_EQ(kinds, (std::vector<JobEventKind>{Released, Ready, Dispatched, Started, Waits, Served, Woken, Resumed,
                                              Waits, Woken, Resumed, Executed, Finished}));
}

TEST_P(DeviceInEveryMode, TheCheckerAcceptsARecordedRun) {
  const testing::RecordedRun run;
  {
    ExecutorOptions options = one_worker_and_gpu(mode());
    options.workers = 2;
    options.record = run.folder().string();
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
  const trace::Trace trace = run.trace();
  ASSERT_EQ(trace.info.workload.platform.devices.size(), 1U);
  EXPECT_EQ(trace.info.workload.platform.devices[0].name, "gpu");
  const Task &detect = trace.info.workload.dags[0].tasks[1];
  ASSERT_EQ(detect.waits.size(), 1U) << "measured, as its wcet is";
  EXPECT_GE(detect.waits[0].longest, 300 * kMicrosecond);
  EXPECT_TRUE(trace.info.workload.dags[0].tasks[0].waits.empty());
  const auto waits = std::count_if(trace.events.begin(), trace.events.end(),
                                   [](const JobEvent &event) { return event.kind == JobEventKind::Waits; });
  EXPECT_GE(waits, 100);
  testing::expect_right(trace);
}

TEST(Device, WrongDevicesAreRefused) {
  ExecutorOptions options = one_worker_and_gpu();
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
