// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Jobs through the scheduler alone, through the engine and through the simulator, for tools/count_instructions to count
// the instructions. The engine has one worker. While a graph runs, no other thread has anything to do.
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <vector>

#include "counted.hpp"
#include "evaluation/benchmarks/graphs.hpp"
#include "evaluation/benchmarks/scheduler_loop.hpp"
#include "evaluation/benchmarks/waiting_pair.hpp"
#include "redag/base/check.hpp"
#include "redag/threads/setup.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "virtual_time.hpp"

namespace {

using namespace redag;
using namespace redag::benchmarks;

constexpr std::uint32_t kMaxActive = 2;

std::uint64_t scheduler_tasks(std::uint64_t jobs, std::size_t tasks, sched::Preemption preemption,
                              std::uint32_t max_active) {
  SchedulerLoop loop(tasks, preemption, max_active);
  for (std::uint64_t i = 0; i < jobs; ++i) loop.step();
  return jobs;
}

std::uint64_t rounds_of(std::uint64_t least, Shape shape) { return (least + nodes_of(shape) - 1) / nodes_of(shape); }

std::uint64_t scheduler_graph(std::uint64_t least, Shape shape, sched::Preemption preemption) {
  SchedulerGraph graph(shape, preemption);
  const std::uint64_t rounds = rounds_of(least, shape);
  std::uint64_t jobs = 0;
  for (std::uint64_t i = 0; i < rounds; ++i) jobs += graph.round();
  REDAG_CHECK(jobs == rounds * nodes_of(shape), "not every node ran once a round");
  return jobs;
}

// Returns false, and says why, if that is an error.
bool is_good(const auto &result) {
  if (!result) std::fprintf(stderr, "%s\n", to_string(result.error()).c_str());
  return result.has_value();
}

Result<runtime::Setup> one_worker(PreemptionMode mode) {
  return runtime::set_up({.preemption = mode, .policy = PolicyKind::Fixed, .workers = 1});
}

std::uint64_t engine_graph(std::uint64_t least, Shape shape, PreemptionMode mode) {
  const Result<runtime::Setup> setup = one_worker(mode);
  if (!is_good(setup)) return 0;
  begin_virtual_time();
  EngineGraph graph(shape, *setup, 0);
  if (!is_good(graph.start())) return 0;
  const std::uint64_t rounds = rounds_of(least, shape);
  graph.run(static_cast<std::uint32_t>(rounds));
  return rounds * nodes_of(shape);
}

std::uint64_t engine_waits(std::uint64_t least, PreemptionMode mode) {
  const Result<runtime::Setup> setup = one_worker(mode);
  if (!is_good(setup)) return 0;
  begin_virtual_time();
  WaitingPair pair(*setup);
  if (!is_good(pair.start())) return 0;
  pair.run(least);
  return least;
}

// With `events`, somebody reads them.
std::uint64_t simulated_tasks(std::uint64_t least, std::size_t tasks, bool events) {
  constexpr std::uint32_t kProcessors = 4;
  const Workload workload = make_workload(tasks, kProcessors, 0);
  double jobs_per_nanosecond = 0;
  for (const TaskRef &ref : flatten(workload)) jobs_per_nanosecond += 1 / static_cast<double>(ref.task->period);
  sim::Options options;
  // One more second for jobs that are unfinished at the horizon.
  options.horizon = static_cast<Duration>(static_cast<double>(least) / jobs_per_nanosecond) + kSecond;
  sim::EventSink sink;
  if (events) sink = [](std::span<const JobEvent>) { return true; };
  sched::PriorityScheduler scheduler(workload, sched::config_of(workload));
  return sim::simulate(workload, scheduler, kProcessors, options, sink).finished;
}

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string &name, auto run) { cases.push_back({name, run}); };
  for (const sched::Preemption preemption : {sched::Preemption::None, sched::Preemption::Full}) {
    const std::string place = preemption == sched::Preemption::None ? "scheduler/none/" : "scheduler/full/";
    for (const Shape shape : {Shape::Single, Shape::Chain, Shape::FanOut, Shape::Random}) {
      add(place + std::string(kShapes[static_cast<std::size_t>(shape)]),
          [=](std::uint64_t least) { return scheduler_graph(least, shape, preemption); });
    }
    for (const std::size_t tasks : {20U, 1'000U, 10'000U}) {
      const std::string name = place + std::to_string(tasks) + "_tasks";
      add(name, [=](std::uint64_t least) { return scheduler_tasks(least, tasks, preemption, 0); });
      add(name + "_bounded",
          [=](std::uint64_t least) { return scheduler_tasks(least, tasks, preemption, kMaxActive); });
    }
  }
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Os}) {
    for (const Shape shape : {Shape::Single, Shape::Chain, Shape::FanOut, Shape::Random}) {
      add("engine/" + std::string(to_string(mode)) + "/" + std::string(kShapes[static_cast<std::size_t>(shape)]),
          [=](std::uint64_t least) { return engine_graph(least, shape, mode); });
    }
    add("engine/" + std::string(to_string(mode)) + "/wait",
        [=](std::uint64_t least) { return engine_waits(least, mode); });
  }
  for (const std::size_t tasks : {20U, 1'000U}) {
    const std::string name = "simulator/" + std::to_string(tasks) + "_tasks";
    add(name, [=](std::uint64_t least) { return simulated_tasks(least, tasks, false); });
    add(name + "_events", [=](std::uint64_t least) { return simulated_tasks(least, tasks, true); });
  }
  return cases;
}

}  // namespace

int main(int argc, char **argv) { return run_counted(argc, argv, all_cases()); }
