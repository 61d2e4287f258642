// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the scheduler's cost per job (release, dispatch, complete, dispatch) by number of tasks and DAGs, with and
// without bounds. Also measures the simulator's speed.
#include <benchmark/benchmark.h>
#include <malloc.h>

#include <vector>

#include "evaluation/benchmarks/scheduler_loop.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace {

using redag::JobEvent;
using redag::Workload;
namespace sched = redag::sched;

std::size_t heap_bytes() {
  const struct mallinfo2 heap = ::mallinfo2();
  return heap.uordblks + heap.hblkhd;
}

void BM_SchedulerStep(benchmark::State &state) {
  redag::benchmarks::SchedulerLoop loop(static_cast<std::size_t>(state.range(0)),
                                        static_cast<sched::Preemption>(state.range(1)),
                                        static_cast<std::uint32_t>(state.range(2)));
  for (auto _ : state) loop.step();
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_SchedulerStep)->ArgNames({"tasks", "mode", "cap"})->ArgsProduct({{20, 1'000, 10'000}, {0, 2}, {0, 2}});

// With events: 0, the scheduler records none.
void BM_Simulator(benchmark::State &state) {
  const Workload workload = redag::benchmarks::make_workload(static_cast<std::size_t>(state.range(0)), 4, 0);
  std::uint64_t jobs = 0;
  std::size_t memory = 0;  // bytes, of the scheduler and the simulator
  const std::size_t before = heap_bytes();
  for (auto _ : state) {
    sched::PriorityScheduler scheduler(workload, redag::sched::config_of(workload));
    redag::sim::Options options;
    options.horizon = 100 * redag::kSecond;
    std::uint64_t events = 0;
    redag::sim::EventSink sink;
    if (state.range(1) != 0) {
      sink = [&](std::span<const JobEvent> batch) {
        if (events == 0) memory = heap_bytes() - before;
        events += batch.size();
        return true;
      };
    }
    jobs += redag::sim::simulate(workload, scheduler, 4, options, sink).finished;
    benchmark::DoNotOptimize(events);
  }
  state.counters["jobs/s"] = benchmark::Counter(static_cast<double>(jobs), benchmark::Counter::kIsRate);
  if (state.range(1) != 0) state.counters["KiB"] = static_cast<double>(memory) / 1024;
}
BENCHMARK(BM_Simulator)
    ->ArgNames({"tasks", "events"})
    ->ArgsProduct({{20, 1'000}, {0, 1}})
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
