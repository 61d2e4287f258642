// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures task sets per second on one worker: n tasks, UUniFast utilizations, log-uniform periods of 10 ms to 1 s,
// D = T, rate-monotonic. The analysis is rta_preemptive with all its terms.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "redag/derived/rng.hpp"
#include "redag_analysis/one_worker/response_time.hpp"

namespace {

struct SimpleTask {
  redag::Duration wcet = 0;
  redag::Duration period = 0;
};

// UUniFast with log-uniform periods. Apart from generate(), so that the task sets behind the measured figures
// (docs/evidence/bounds.md) stay the same.
std::vector<SimpleTask> random_tasks(redag::Rng &rng, std::size_t count, double utilization) {
  std::vector<SimpleTask> tasks;
  for (std::size_t i = 0; i < count; ++i) {
    const double rest =
        i + 1 < count ? utilization * std::pow(rng.uniform01(), 1.0 / static_cast<double>(count - 1 - i)) : 0.0;
    const auto period = static_cast<redag::Duration>(1e7 * std::pow(100.0, rng.uniform01()));
    const auto wcet = static_cast<redag::Duration>((utilization - rest) * static_cast<double>(period));
    tasks.push_back({std::max<redag::Duration>(1, wcet), period});
    utilization = rest;
  }
  std::sort(tasks.begin(), tasks.end(), [](const SimpleTask &a, const SimpleTask &b) { return a.period < b.period; });
  return tasks;
}

std::vector<std::vector<SimpleTask>> random_sets(std::size_t count, double utilization) {
  redag::Rng rng(1);
  std::vector<std::vector<SimpleTask>> sets;
  for (int i = 0; i < 1000; ++i) sets.push_back(random_tasks(rng, count, utilization));
  return sets;
}

// The arguments are the number of tasks and the utilization in percent.
void response_times(benchmark::State &state) {
  std::vector<redag::analysis::TaskSet> task_sets;
  for (const auto &set :
       random_sets(static_cast<std::size_t>(state.range(0)), static_cast<double>(state.range(1)) / 100)) {
    redag::Workload workload;
    workload.dags.emplace_back();
    for (const SimpleTask &numbers : set) {
      redag::Task task;
      task.wcet = task.bcet = numbers.wcet;
      task.period = task.deadline = numbers.period;
      task.name = "t" + std::to_string(workload.dags[0].tasks.size());
      workload.dags[0].tasks.push_back(task);
    }
    workload.name = workload.dags[0].name = "d";
    const auto task_set = redag::analysis::compile(workload, {});
    if (!task_set) return state.SkipWithError("a set that does not compile");
    task_sets.push_back(*task_set);
  }
  const redag::analysis::Method method = redag::analysis::rta_preemptive();
  for (auto _ : state) {
    for (const auto &task_set : task_sets) benchmark::DoNotOptimize(method.apply(task_set));
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(task_sets.size()));
}
BENCHMARK(response_times)->Name("ResponseTimes")->ArgsProduct({{20}, {80}});

}  // namespace
