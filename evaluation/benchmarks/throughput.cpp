// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures jobs per second when there are always more ready jobs than workers. The result is the most that scheduling
// costs, and shows whether throughput collapses with more workers than processors. Each of 64 tasks releases its next
// job from its body. oneTBB, which runs its tasks in no order, is the reference. In a ring, each body releases the next
// task and returns: a second worker has nothing to gain, and must not cost either.
#include <benchmark/benchmark.h>
#include <oneapi/tbb/task_arena.h>
#include <pthread.h>
#include <sys/resource.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"

namespace {

using namespace redag;
using namespace redag::runtime;

constexpr std::uint32_t kTasks = 64;
constexpr auto kRun = std::chrono::milliseconds(300);

void spin_for(Duration duration) {
  const Time end = monotonic_now() + duration;
  while (duration > 0 && monotonic_now() < end) {
  }
}

void BM_Engine(benchmark::State &state) {
  const auto workers = static_cast<std::uint32_t>(state.range(0));
  const auto wanted = static_cast<PreemptionMode>(state.range(1));
  const Duration work = state.range(2) * kMicrosecond;
  Result<Setup> setup = set_up({.preemption = wanted, .workers = workers});
  if (!setup) return state.SkipWithError("this mode cannot be had here");
  Workload workload;
  workload.dags.emplace_back();
  for (std::uint32_t t = 0; t < kTasks; ++t) {
    Task task;
    task.period = task.deadline = (t + 1) * kMillisecond;
    task.wcet = kMillisecond;
    workload.dags[0].tasks.push_back(task);
  }
  std::uint64_t jobs = 0;
  double seconds = 0;
  for (auto _ : state) {
    EngineOptions options;
    options.config = setup->config;
    options.band = setup->band;
    Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    std::vector<std::atomic<std::uint64_t>> done(kTasks);
    std::vector<Body> bodies(kTasks, [&](const runtime::Job &job) {
      spin_for(work);
      done[job.task.value].fetch_add(1, std::memory_order_relaxed);
      engine.release(job.task, 0);
      return sched::Outcome::Finished;
    });
    engine.bind(workload, std::move(bodies));
    engine.set_origin(monotonic_now());
    if (!engine.start()) return state.SkipWithError("threads cannot be started");
    // This thread gets the release timer's priority. Otherwise busy workers would keep it from ending the run.
    if (setup->timer_priority() > 0) (void)set_fifo_priority(pthread_self(), setup->timer_priority());
    const Time begin = monotonic_now();
    for (std::uint32_t t = 0; t < kTasks; ++t) engine.release(TaskId(t), 0);
    std::this_thread::sleep_for(kRun);
    engine.halt();
    (void)engine.wait_idle(kNever);
    const Duration took = monotonic_now() - begin;
    engine.join();
    const sched_param normal{};
    pthread_setschedparam(pthread_self(), SCHED_OTHER, &normal);
    for (const auto &count : done) jobs += count;
    seconds += static_cast<double>(took) / kSecond;
    state.SetIterationTime(static_cast<double>(took) / kSecond);
  }
  state.counters["jobs/s"] = static_cast<double>(jobs) / seconds;
}
BENCHMARK(BM_Engine)
    ->ArgNames({"workers", "mode", "us"})
    ->ArgsProduct({{1, 2, 4, 8, 16},
                   {static_cast<int>(PreemptionMode::None), static_cast<int>(PreemptionMode::Os)},
                   {0, 10}})
    ->UseManualTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

std::uint64_t context_switches() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_nvcsw) + static_cast<std::uint64_t>(usage.ru_nivcsw);
}

// One message goes round. A ring of one task is a callback that may overlap itself, in a reentrant group.
void BM_Ring(benchmark::State &state) {
  const auto tasks = static_cast<std::uint32_t>(state.range(0));
  const auto workers = static_cast<std::uint32_t>(state.range(1));
  const auto wanted = static_cast<PreemptionMode>(state.range(2));
  const Duration work = state.range(3) * kMicrosecond;
  Result<Setup> setup = set_up({.preemption = wanted, .workers = workers});
  if (!setup) return state.SkipWithError("this mode cannot be had here");
  Workload workload;
  workload.dags.emplace_back();
  for (std::uint32_t t = 0; t < tasks; ++t) {
    Task task;
    task.period = task.deadline = task.wcet = kMillisecond;
    task.concurrency = 2;
    workload.dags[0].tasks.push_back(task);
  }
  std::uint64_t jobs = 0;
  std::uint64_t switches = 0;
  double seconds = 0;
  for (auto _ : state) {
    EngineOptions options;
    options.config = setup->config;
    options.band = setup->band;
    Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    std::atomic<std::uint64_t> done{0};
    std::vector<Body> bodies(tasks, [&](const runtime::Job &job) {
      spin_for(work);
      done.fetch_add(1, std::memory_order_relaxed);
      engine.release(TaskId((job.task.value + 1) % tasks), 0);
      return sched::Outcome::Finished;
    });
    engine.bind(workload, std::move(bodies));
    engine.set_origin(monotonic_now());
    if (!engine.start()) return state.SkipWithError("threads cannot be started");
    switches -= context_switches();
    const Time begin = monotonic_now();
    engine.release(TaskId(0), 0);
    std::this_thread::sleep_for(kRun);
    engine.halt();
    (void)engine.wait_idle(kNever);
    const Duration took = monotonic_now() - begin;
    switches += context_switches();
    engine.join();
    jobs += done;
    seconds += static_cast<double>(took) / kSecond;
    state.SetIterationTime(static_cast<double>(took) / kSecond);
  }
  state.counters["jobs/s"] = static_cast<double>(jobs) / seconds;
  state.counters["switches/job"] = static_cast<double>(switches) / static_cast<double>(jobs);
}
BENCHMARK(BM_Ring)
    ->ArgNames({"tasks", "workers", "mode", "us"})
    ->ArgsProduct(
        {{1, 50}, {1, 2}, {static_cast<int>(PreemptionMode::None), static_cast<int>(PreemptionMode::Os)}, {0, 3}})
    ->UseManualTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

void BM_Tbb(benchmark::State &state) {
  const auto workers = static_cast<int>(state.range(0));
  const Duration work = state.range(1) * kMicrosecond;
  std::uint64_t jobs = 0;
  double seconds = 0;
  for (auto _ : state) {
    tbb::task_arena arena(workers, 0);
    std::atomic<bool> stop{false};
    std::atomic<std::uint32_t> left{kTasks};
    std::vector<std::atomic<std::uint64_t>> done(kTasks);
    std::function<void(std::uint32_t)> body = [&](std::uint32_t task) {
      spin_for(work);
      done[task].fetch_add(1, std::memory_order_relaxed);
      if (stop.load(std::memory_order_relaxed)) {
        --left;
      } else {
        arena.enqueue([&, task] { body(task); });
      }
    };
    const Time begin = monotonic_now();
    for (std::uint32_t t = 0; t < kTasks; ++t) arena.enqueue([&, t] { body(t); });
    std::this_thread::sleep_for(kRun);
    stop = true;
    while (left > 0) std::this_thread::sleep_for(std::chrono::microseconds(100));
    const Duration took = monotonic_now() - begin;
    for (const auto &count : done) jobs += count;
    seconds += static_cast<double>(took) / kSecond;
    state.SetIterationTime(static_cast<double>(took) / kSecond);
  }
  state.counters["jobs/s"] = static_cast<double>(jobs) / seconds;
}
BENCHMARK(BM_Tbb)
    ->ArgNames({"workers", "us"})
    ->ArgsProduct({{1, 2, 4, 8, 16}, {0, 10}})
    ->UseManualTime()
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
