// What one job costs the scheduler: release + dispatch + complete + dispatch, by number of tasks and DAGs, with and
// without bounds; and the simulator's speed.
#include <benchmark/benchmark.h>

#include <vector>

#include "redag/base/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/sim/simulator.hpp"

namespace {

using redag::Dag;
using redag::JobEvent;
using redag::TaskId;
using redag::Workload;
namespace sched = redag::sched;

// `count` independent timer tasks in DAGs of ten, periods spread over three decades.
Workload make_workload(std::size_t count, std::uint32_t workers, std::uint32_t max_active) {
  Workload workload;
  workload.platform = {workers, redag::PreemptionMode::Os};
  redag::Rng rng(1);
  for (std::size_t i = 0; i < count; ++i) {
    if (i % 10 == 0) {
      workload.dags.emplace_back();
      workload.dags.back().max_active = max_active;
    }
    redag::Task task;
    task.period = rng.uniform(1, 1000) * redag::kMillisecond;
    task.deadline = task.period;
    task.wcet =
        static_cast<redag::Duration>(0.7 * workers * static_cast<double>(task.period) / static_cast<double>(count));
    workload.dags.back().tasks.push_back(task);
  }
  return workload;
}

// Keeps `m` jobs running: each step ends one and releases one. Ready jobs: about half the tasks.
void BM_SchedulerStep(benchmark::State &state) {
  const auto count = static_cast<std::size_t>(state.range(0));
  const auto mode = static_cast<sched::Preemption>(state.range(1));
  const auto max_active = static_cast<std::uint32_t>(state.range(2));
  const Workload workload = make_workload(count, 4, max_active);
  sched::PriorityScheduler scheduler(workload, {4, mode, redag::PolicyKind::RateMonotonic, 0, 0});
  redag::Rng rng(7);
  std::vector<redag::JobSlot> running(4);
  redag::Time now = 0;
  std::uint64_t verbs = 0;
  const auto carry_out = [&](const sched::Step &step) {
    for (const auto &dispatch : step.dispatches) running[dispatch.worker.value] = dispatch.job;
  };
  std::vector<std::uint32_t> order(1 << 16);
  for (auto &task : order) task = static_cast<std::uint32_t>(rng.uniform(0, static_cast<std::int64_t>(count) - 1));
  for (std::size_t i = 0; i < count / 2 + 4; ++i) scheduler.release(TaskId(order[i]), now, now);
  carry_out(scheduler.dispatch(now));
  for (auto _ : state) {
    ++now;
    scheduler.release(TaskId(order[verbs & 0xffff]), now, now);
    carry_out(scheduler.dispatch(now));
    const auto worker = verbs & 3;
    if (running[worker].valid()) {
      const redag::JobSlot ended = running[worker];
      running[worker] = redag::JobSlot();
      scheduler.complete(ended, now, sched::Outcome::Finished);
      carry_out(scheduler.dispatch(now));
    }
    ++verbs;
  }
  state.SetItemsProcessed(state.iterations());
}
BENCHMARK(BM_SchedulerStep)->ArgNames({"tasks", "mode", "cap"})->ArgsProduct({{20, 1'000, 10'000}, {0, 2}, {0, 2}});

void BM_Simulator(benchmark::State &state) {
  const Workload workload = make_workload(static_cast<std::size_t>(state.range(0)), 4, 0);
  std::uint64_t jobs = 0;
  for (auto _ : state) {
    sched::PriorityScheduler scheduler(workload, redag::sim::simulated_config(workload));
    redag::sim::Options options;
    options.horizon = 100 * redag::kSecond;
    std::uint64_t events = 0;
    jobs += redag::sim::simulate(workload, scheduler, 4, options, [&](std::span<const JobEvent> batch) {
              events += batch.size();
              return true;
            }).finished;
    benchmark::DoNotOptimize(events);
  }
  state.counters["jobs/s"] = benchmark::Counter(static_cast<double>(jobs), benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Simulator)->ArgName("tasks")->Arg(20)->Arg(1'000)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
