// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures how fast a workload file is read. The workloads are generated, with DAGs of ten tasks each.
#include <benchmark/benchmark.h>

#include <string>

#include "redag/loader/workload_yaml.hpp"

namespace {

using namespace redag;

std::string text_of(std::int64_t tasks) {
  constexpr std::int64_t kPerDag = 10;
  std::string text = "name: many\nplatform: {workers: 4}\ndags:\n";
  for (std::int64_t dag = 0; dag < tasks / kPerDag; ++dag) {
    text += "  - name: d" + std::to_string(dag) + "\n    period: 100ms\n    tasks:\n";
    for (std::int64_t task = 0; task < kPerDag; ++task) {
      text += "      - {name: t" + std::to_string(task) + ", wcet: 300us";
      if (task > 0) text += ", after: [t" + std::to_string(task - 1) + "], activation: data";
      text += "}\n";
    }
  }
  return text;
}

void load_yaml(benchmark::State &state) {
  const std::string text = text_of(state.range(0));
  for (auto _ : state) {
    const Result<LoadedWorkload> loaded = parse_workload(text, "many.yaml");
    if (!loaded) return state.SkipWithError(to_string(loaded.error()).c_str());
    benchmark::DoNotOptimize(loaded->workload.dags.data());
  }
  state.counters["tasks/s"] =
      benchmark::Counter(static_cast<double>(state.iterations() * state.range(0)), benchmark::Counter::kIsRate);
  state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(text.size()));
}
BENCHMARK(load_yaml)->ArgName("tasks")->Arg(1'000)->Arg(100'000)->Unit(benchmark::kMillisecond);

}  // namespace
