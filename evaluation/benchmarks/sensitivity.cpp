// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the speed of searches over the bounds, in task sets of 20 independent tasks per second: the critical scaling
// factor of all wcets, and all knobs.
#include <benchmark/benchmark.h>

#include <vector>

#include "redag_lab/search/sensitivity.hpp"
#include "redag_lab/workload/generate.hpp"

namespace {

using redag::Workload;
namespace analysis = redag::analysis;
namespace lab = redag::lab;

std::vector<Workload> sets(std::uint32_t workers) {
  constexpr std::size_t kSets = 32;
  std::vector<Workload> result;
  for (std::uint64_t seed = 0; result.size() < kSets; ++seed) {
    lab::GenerateOptions options;
    options.shape = lab::DagShape::Independent;
    options.workers = workers;
    options.preemption = redag::PreemptionMode::Os;
    options.dags = 20;
    options.min_tasks = options.max_tasks = 1;
    options.utilization = 0.5 * workers;
    if (const redag::Result<Workload> workload = lab::generate(options, seed)) result.push_back(*workload);
  }
  return result;
}

// Calls run(workload, platform) on each set in turn.
template <class Run>
void on_sets(benchmark::State &state, Run run) {
  const std::vector<Workload> all = sets(static_cast<std::uint32_t>(state.range(0)));
  std::size_t next = 0;
  for (auto _ : state) {
    const Workload &workload = all[next++ % all.size()];
    run(workload, analysis::platform_of(workload));
  }
  state.SetItemsProcessed(state.iterations());
}

void BM_ShownSchedulable(benchmark::State &state) {
  on_sets(state, [](const Workload &workload, const analysis::AnalysisPlatform &platform) {
    benchmark::DoNotOptimize(analysis::is_shown_schedulable(*analysis::compile(workload, platform)));
  });
}

void BM_CriticalScalingFactor(benchmark::State &state) {
  on_sets(state, [](const Workload &workload, const analysis::AnalysisPlatform &platform) {
    benchmark::DoNotOptimize(lab::margin_of(workload, platform, lab::knobs_of(workload).front()));
  });
}

void BM_Sensitivity(benchmark::State &state) {
  on_sets(state, [](const Workload &workload, const analysis::AnalysisPlatform &platform) {
    for (const lab::Knob &knob : lab::knobs_of(workload)) {
      benchmark::DoNotOptimize(lab::margin_of(workload, platform, knob));
    }
  });
}

}  // namespace

BENCHMARK(BM_ShownSchedulable)->Arg(1)->Arg(4);
BENCHMARK(BM_CriticalScalingFactor)->Arg(1)->Arg(4);
BENCHMARK(BM_Sensitivity)->Arg(1)->Arg(4)->Unit(benchmark::kMillisecond);
