// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/simulated_misses.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "redag/base/rng.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/experiment/seed.hpp"

namespace redag::experiment {
namespace {

// Describes a miss: "b.t: job 3 answered after at least 12ms, its deadline is 10ms".
std::string words_of(const metrics::JudgedJob &job, const Workload &workload, const analysis::TaskSet &task_set) {
  const metrics::JobRecord &record = job.record;
  const std::string name = fmt::format("{}: job {}", trace::task_name(workload, record.task), record.number);
  const analysis::CompiledTask &task = task_set.tasks[record.task.value];
  switch (job.miss) {
    case metrics::Miss::None: break;
    case metrics::Miss::Lost: return fmt::format("{} was {}", name, to_string(record.outcome));
    case metrics::Miss::Deadline:
      return fmt::format("{} had a response time of at least {}; its deadline is {}", name,
                         format_duration(*job.response), format_duration(task.deadline));
    case metrics::Miss::EndToEnd:
      return fmt::format("{} had an end-to-end response time of at least {}; its DAG's end-to-end deadline is {}", name,
                         format_duration(*job.end_to_end), format_duration(task_set.dags[task.dag.value].deadline));
  }
  return {};
}

// Returns the workload of all runs: every job takes its wcet, and none is released before time 0.
Workload at_worst(const Workload &workload) {
  Workload worst = workload;
  for (Dag &dag : worst.dags) {
    for (Task &task : dag.tasks) {
      task.bcet = task.wcet;
      task.execution = ExecutionTime{};
      task.offset = 0;
    }
  }
  return worst;
}

// Draws an offset for each unit; its tasks are released together.
void draw_offsets(Workload &workload, const analysis::TaskSet &task_set, Rng &rng) {
  std::vector<Duration> offsets;
  for (const analysis::Unit &unit : task_set.units) offsets.push_back(rng.uniform(0, unit.period - 1));
  std::size_t id = 0;
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.activation == Activation::Timer) task.offset = offsets[task_set.tasks[id].unit];
      ++id;
    }
  }
}

}  // namespace

std::optional<SeenMiss> find_miss(const Workload &workload, const analysis::TaskSet &task_set,
                                  const SimulationEffort &effort, std::uint64_t seed) {
  Duration slowest = 0;
  for (const analysis::CompiledTask &task : task_set.tasks) slowest = std::max(slowest, task.period);
  const sched::Config config = sched::config_of(workload);
  SeenMiss run{at_worst(workload), 0, 0, {}};
  for (std::uint32_t i = 0; i <= effort.offsets; ++i) {
    run.seed = derive_seed(seed, {i});
    if (i > 0) {
      Rng rng(run.seed);
      draw_offsets(run.workload, task_set, rng);
    }
    run.duration = slowest * (effort.periods + (i > 0 ? 1 : 0));
    sim::Options options;
    options.horizon = run.duration;
    options.seed = run.seed;
    sched::PriorityScheduler scheduler(run.workload, config);
    metrics::DeadlineWatch watch(run.workload);
    const auto see = [&](const metrics::JudgedJob &job) {
      if (run.what.empty()) run.what = words_of(job, run.workload, task_set);
    };
    const sim::Result result =
        sim::simulate(run.workload, scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
          watch.add(events, see);
          return run.what.empty();
        });
    watch.finish(result.end, see);
    if (!run.what.empty()) return run;
  }
  return std::nullopt;
}

}  // namespace redag::experiment
