// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the speed of the bounds for several workers, in task sets per second. Guan runs on 20 tasks and 4 workers:
// once on bare numbers, once as a method with its terms. Melani and related methods run on sets of 2-5 DAGs of 3-9
// tasks on 4 workers.
#include <benchmark/benchmark.h>

#include <cmath>
#include <variant>
#include <vector>

#include "redag/derived/rng.hpp"
#include "redag_analysis/many_workers/global_dag.hpp"
#include "redag_analysis/many_workers/global_sequential.hpp"
#include "redag_lab/workload/generate.hpp"

namespace {

using redag::Duration;
using redag::Workload;
namespace analysis = redag::analysis;
namespace lab = redag::lab;
using analysis::global::GlobalUnit;

constexpr std::uint32_t kWorkers = 4;
constexpr std::size_t kSets = 256;  // more than the branch predictor can memorize

std::vector<analysis::TaskSet> task_sets(lab::DagShape shape, std::uint32_t percent) {
  const bool graphs = shape != lab::DagShape::Independent;
  std::vector<analysis::TaskSet> result;
  for (std::uint64_t seed = 0; result.size() < kSets; ++seed) {
    lab::GenerateOptions options;
    options.shape = shape;
    options.workers = kWorkers;
    options.preemption = redag::PreemptionMode::Os;
    options.dags = graphs ? static_cast<std::uint32_t>(redag::Rng(redag::mix(seed)).uniform(2, 5)) : 20;
    options.min_tasks = graphs ? 3 : 1;
    options.max_tasks = graphs ? 9 : 1;
    options.utilization = kWorkers * percent / 100.0;
    redag::Result<Workload> workload = lab::generate(options, seed);
    if (!workload) continue;
    workload->ties = redag::Ties::Fixed;  // guan() takes no equals
    result.push_back(analysis::compile(*workload, analysis::platform_of(*workload)).value());
  }
  return result;
}

std::vector<std::vector<GlobalUnit>> bare(const std::vector<analysis::TaskSet> &sets) {
  std::vector<std::vector<GlobalUnit>> result;
  result.reserve(sets.size());
  for (const analysis::TaskSet &task_set : sets) result.push_back(analysis::global::units_of(task_set, {}).units);
  return result;
}

// Calls respond() on all tasks of each set in turn until one has no bound. Reports how many sets had a bound for every
// task.
template <class Respond>
void run_bare(benchmark::State &state, std::vector<std::vector<GlobalUnit>> sets, Respond respond) {
  std::size_t next = 0;
  std::int64_t schedulable = 0;
  for (auto _ : state) {
    std::vector<GlobalUnit> &units = sets[next++ % kSets];
    bool all = true;
    for (std::size_t k = 0; k < units.size() && all; ++k) all = respond(units, k);
    schedulable += all ? 1 : 0;
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["bounded"] = static_cast<double>(schedulable) / static_cast<double>(state.iterations());
}

void run_method(benchmark::State &state, const analysis::Method &method, lab::DagShape shape) {
  const auto sets = task_sets(shape, static_cast<std::uint32_t>(state.range(0)));
  for (const analysis::TaskSet &task_set : sets) {
    if (!std::holds_alternative<analysis::Bound>(method.apply(task_set))) return state.SkipWithError("does not apply");
  }
  std::size_t next = 0;
  for (auto _ : state) benchmark::DoNotOptimize(method.apply(sets[next++ % kSets]));
  state.SetItemsProcessed(state.iterations());
}

void BM_GuanBare(benchmark::State &state) {
  const auto sets = task_sets(lab::DagShape::Independent, static_cast<std::uint32_t>(state.range(0)));
  run_bare(state, bare(sets), [](std::vector<GlobalUnit> &units, std::size_t k) {
    return analysis::global::guan_response(units, k, kWorkers, analysis::global::start_after(units, k));
  });
}

void BM_Guan(benchmark::State &state) { run_method(state, analysis::guan(), lab::DagShape::Independent); }

void BM_DagBounded(benchmark::State &state) { run_method(state, analysis::dag_bounded(), lab::DagShape::Layered); }

}  // namespace

BENCHMARK(BM_GuanBare)->Arg(40)->Arg(60)->Arg(80);
BENCHMARK(BM_Guan)->Arg(40)->Arg(60)->Arg(80);
BENCHMARK(BM_DagBounded)->Arg(30)->Arg(60);
