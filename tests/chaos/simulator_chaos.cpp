// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>

#include "redag/derived/rng.hpp"
#include "redag/loader/validate.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/chaos/chaos.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::chaos {
namespace {

// Replaces microseconds by years in a random workload: releases, deadlines and the end then come near the largest
// representable time.
void stretch(Workload &workload, Duration factor) {
  const auto scale = [factor](Duration &time) { time *= factor; };
  for (Dag &dag : workload.dags) {
    scale(dag.deadline);
    for (Task &task : dag.tasks) {
      for (Duration *time : {&task.wcet, &task.wcet_low, &task.bcet, &task.period, &task.deadline, &task.offset,
                             &task.jitter, &task.region, &task.budget, &task.execution.mean, &task.execution.stddev}) {
        scale(*time);
      }
      for (Duration &sample : task.execution.samples) scale(sample);
      for (Wait &wait : task.waits) {
        for (Duration *time : {&wait.after, &wait.longest, &wait.shortest}) scale(*time);
      }
    }
  }
}

Duration longest_time(const Workload &workload) {
  Duration longest = 1;
  for (const TaskRef &ref : flatten(workload)) {
    longest = std::max({longest, ref.task->period, ref.task->deadline, ref.task->offset, ref.task->wcet});
  }
  return longest;
}

}  // namespace

std::string simulator_run(std::uint64_t seed, Survived &survived) {
  Rng rng(seed);
  const auto executors = executors::all();
  const executors::ExecutorKind &kind =
      rng.uniform01() < 0.6 ? executors.front()
                            : executors[static_cast<std::size_t>(rng.uniform(0, std::ssize(executors) - 1))];
  testing::RandomRun run = testing::random_run(rng);
  Workload &workload = run.workload;
  if (!kind.ours) {  // models of other executors know no waits, and some only one worker
    workload.platform.clusters.clear();
    for (Dag &dag : workload.dags) {
      dag.cluster.clear();
      for (Task &task : dag.tasks) task.waits.clear();
    }
  }
  const Duration longest = longest_time(workload);
  const Duration horizon = 20 * longest;
  const bool far = rng.uniform01() < 0.3;
  const Duration factor = far ? trace::kMaxTraceTime / horizon : 1;
  stretch(workload, factor);
  if (has_errors(validate(workload, {.waits = true})))
    return "the random workload is not valid: " + to_string(validate(workload, {.waits = true}));

  trace::Trace trace;
  trace.info.config = executors::effective_config(kind, run.config);
  trace.info.workload = workload;
  trace.info.executor = kind.name;
  trace.info.driver = trace::Driver::Simulator;
  trace.info.seed = seed;

  sim::Options options;
  options.horizon = std::min(horizon * factor, trace::kMaxTraceTime);
  options.seed = seed;
  const double overruns = rng.uniform01() < 0.5 ? 0 : rng.uniform01();
  std::uint64_t overrun = 0;
  const std::uint64_t demands = rng();
  options.demand = [&](const Task &task, TaskId id, std::uint32_t number) {
    Rng dice = Rng::stream(demands, id.value, number);
    if (dice.uniform01() >= overruns) return task.wcet;
    ++overrun;
    return std::max(task.wcet, std::min(task.wcet, kMaxDuration / 100) * dice.uniform(2, 100));
  };
  const std::uint64_t most = rng.uniform01() < 0.3 ? static_cast<std::uint64_t>(rng.uniform(1, 60)) : 20'000;
  const auto scheduler = executors::make_scheduler(kind.name, workload, trace.info.config);
  const sim::Result result =
      sim::simulate(workload, *scheduler, trace.info.config.workers, options, [&](std::span<const JobEvent> events) {
        trace.events.insert(trace.events.end(), events.begin(), events.end());
        return trace.events.size() < most;
      });
  trace.info.end = result.end;
  // Jobs run for other times than the workload states, and the check must not judge their execution times and waits.
  const metrics::CheckReport report = metrics::check_trace(
      trace, metrics::rules_for(trace.info).without(metrics::Rule::Execution).without(metrics::Rule::Device));
  if (!report.ok()) return report.to_string() + testing::describe(workload, trace.info.config);
  survived["jobs"] += result.released;
  survived["jobs that overran their wcet up to 100 times"] += overrun;
  survived["runs near the largest time"] += far ? 1 : 0;
  survived["runs broken off"] += result.end < options.horizon ? 1 : 0;
  survived["runs of " + std::string(kind.name)] += 1;
  return {};
}

}  // namespace redag::chaos
