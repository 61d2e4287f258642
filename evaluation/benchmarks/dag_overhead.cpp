// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the cost of a DAG node with an empty body, in chains, fan-outs and random graphs of 64 nodes. The last node
// starts the graph anew. For comparison, the same graphs run on oneTBB's flow graph and, where its headers are found,
// on Taskflow. Both ignore priorities and timing. cpu_ns/node counts all threads.
#include <benchmark/benchmark.h>
#include <oneapi/tbb/flow_graph.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>
#include <pthread.h>
#if __has_include(<taskflow/taskflow.hpp>)
#include <taskflow/taskflow.hpp>
#define REDAG_HAS_TASKFLOW 1
#endif

#include <atomic>
#include <memory>
#include <string>
#include <vector>

#include "evaluation/benchmarks/graphs.hpp"
#include "redag/runtime/spins.hpp"
#include "redag/threads/clock.hpp"

namespace {

using namespace redag;
using namespace redag::runtime;
using namespace redag::benchmarks;

constexpr std::uint32_t kRounds = 1000;

class Cost {
 public:
  explicit Cost(benchmark::State &state) : state_(state) {}
  ~Cost() {
    const double nodes = static_cast<double>(state_.iterations()) * kRounds * kNodes;
    state_.counters["ns/node"] = static_cast<double>(wall_) / nodes;
    state_.counters["cpu_ns/node"] = static_cast<double>(cpu_) / nodes;
  }
  Cost(const Cost &) = delete;
  Cost &operator=(const Cost &) = delete;

  template <class F>
  void of(F &&rounds) {
    const Duration cpu = process_cpu_now();
    const Time begin = monotonic_now();
    rounds();
    const Duration took = monotonic_now() - begin;
    wall_ += took;
    cpu_ += process_cpu_now() - cpu;
    state_.SetIterationTime(static_cast<double>(took) / kSecond);
  }

 private:
  static Duration process_cpu_now() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return time.tv_sec * kSecond + time.tv_nsec;
  }

  benchmark::State &state_;
  Duration wall_ = 0;
  Duration cpu_ = 0;
};

void redag_engine(benchmark::State &state, Shape shape, PreemptionMode mode, Duration spin = 0) {
  const auto workers = static_cast<std::uint32_t>(state.range(0));
  Result<Setup> setup = set_up({.preemption = mode, .policy = PolicyKind::Fixed, .workers = workers});
  if (!setup) return state.SkipWithError("this mode cannot be had here");
  EngineGraph graph(shape, *setup, spins_in(spin));
  if (!graph.start()) return state.SkipWithError("threads cannot be started");
  Cost cost(state);
  for (auto _ : state) {
    cost.of([&] { graph.run(kRounds); });
  }
}

void tbb_flow_graph(benchmark::State &state, Shape shape) {
  const auto workers = static_cast<std::size_t>(state.range(0));
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, workers);
  tbb::task_arena arena(static_cast<int>(workers));
  Cost cost(state);
  arena.execute([&] {
    using Node = tbb::flow::continue_node<tbb::flow::continue_msg>;
    tbb::flow::graph graph;
    std::uint32_t left = 0;
    std::vector<std::atomic<std::uint32_t>> runs(kNodes);
    std::vector<std::unique_ptr<Node>> nodes;
    const auto predecessors = predecessors_of(shape);
    for (std::uint32_t v = 0; v < kNodes; ++v) {
      nodes.push_back(std::make_unique<Node>(graph, [&, v](const tbb::flow::continue_msg &) {
        runs[v].fetch_add(1, std::memory_order_relaxed);
        if (v + 1 == kNodes && --left > 0) nodes[0]->try_put(tbb::flow::continue_msg());
      }));
      for (const std::uint32_t u : predecessors[v]) tbb::flow::make_edge(*nodes[u], *nodes[v]);
    }
    for (auto _ : state) {
      left = kRounds;
      cost.of([&] {
        nodes[0]->try_put(tbb::flow::continue_msg());
        graph.wait_for_all();
      });
    }
  });
}

#ifdef REDAG_HAS_TASKFLOW
void taskflow(benchmark::State &state, Shape shape) {
  tf::Executor executor(static_cast<std::size_t>(state.range(0)));
  tf::Taskflow flow;
  std::vector<std::atomic<std::uint32_t>> runs(kNodes);
  std::vector<tf::Task> nodes;
  const auto predecessors = predecessors_of(shape);
  for (std::uint32_t v = 0; v < kNodes; ++v) {
    nodes.push_back(flow.emplace([&runs, v] { runs[v].fetch_add(1, std::memory_order_relaxed); }));
    for (const std::uint32_t u : predecessors[v]) nodes[u].precede(nodes[v]);
  }
  Cost cost(state);
  for (auto _ : state) {
    cost.of([&] { executor.run_n(flow, kRounds).wait(); });
  }
}
#endif

[[maybe_unused]] const bool registered = [] {
  const auto add = [](const std::string &name, auto function) {
    benchmark::RegisterBenchmark(name.c_str(), function)
        ->ArgName("workers")
        ->Arg(1)
        ->Arg(2)
        ->UseManualTime()
        ->Unit(benchmark::kMillisecond);
  };
  for (const Shape shape : {Shape::Chain, Shape::FanOut, Shape::Random}) {
    const std::string name(kShapes[static_cast<std::size_t>(shape)]);
    add(name + "/redag_none", [=](benchmark::State &state) { redag_engine(state, shape, PreemptionMode::None); });
    add(name + "/redag_none_spin_50us",
        [=](benchmark::State &state) { redag_engine(state, shape, PreemptionMode::None, 50 * kMicrosecond); });
    add(name + "/redag_os", [=](benchmark::State &state) { redag_engine(state, shape, PreemptionMode::Os); });
    add(name + "/tbb_flow_graph", [=](benchmark::State &state) { tbb_flow_graph(state, shape); });
#ifdef REDAG_HAS_TASKFLOW
    add(name + "/taskflow", [=](benchmark::State &state) { taskflow(state, shape); });
#endif
  }
  return true;
}();

}  // namespace
