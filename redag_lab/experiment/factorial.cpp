// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "redag/model/validate.hpp"
#include "redag_lab/experiment/seed.hpp"

namespace redag::experiment {
namespace {

Duration scaled(Duration value, double factor) {
  if (value <= 0) return value;
  return std::max<Duration>(1, std::llround(static_cast<double>(value) * factor));
}

double mean_execution(const Task &task) {
  switch (task.execution.kind) {
    case ExecutionTime::Kind::Constant: return static_cast<double>(task.wcet);
    case ExecutionTime::Kind::Uniform: return static_cast<double>(task.bcet + task.wcet) / 2;
    case ExecutionTime::Kind::Normal: return static_cast<double>(task.execution.mean);
    case ExecutionTime::Kind::Empirical: break;
  }
  const std::vector<Duration> &samples = task.execution.samples;
  return std::accumulate(samples.begin(), samples.end(), 0.0) / static_cast<double>(samples.size());
}

void scale_demand(Workload &workload, double factor) {
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      for (Duration *value : {&task.wcet, &task.bcet, &task.wcet_low, &task.region, &task.budget, &task.execution.mean,
                              &task.execution.stddev}) {
        *value = scaled(*value, factor);
      }
      for (Duration &sample : task.execution.samples) sample = scaled(sample, factor);
      task.bcet = std::min(task.bcet, task.wcet);
    }
  }
}

void scale_deadlines(Workload &workload, double factor) {
  for (Dag &dag : workload.dags) {
    dag.deadline = scaled(dag.deadline, factor);
    for (Task &task : dag.tasks) task.deadline = scaled(task.deadline, factor);
  }
}

double share(std::uint32_t millionths) { return millionths / static_cast<double>(kMillion); }

}  // namespace

double mean_utilization(const Workload &workload) {
  double sum = 0;
  for (const TaskRef &ref : flatten(workload)) {
    sum += mean_execution(*ref.task) / static_cast<double>(ref.task->period);
  }
  return sum;
}

Factorial::Factorial(FactorialPlan plan, Drive drive)
    : plan_(std::move(plan)),
      drive_(std::move(drive)),
      factors_(factors_of(plan_)),
      points_(experiment::points_of(plan_)) {
  for (std::size_t p = 0; p < points_.size(); ++p) {
    if (plan_.executors[points_[p].of(FactorKind::Executor)] == kIdeal) ideals_.push_back(p);
  }
}

std::optional<std::size_t> Factorial::ideal_of(std::size_t point) const {
  for (const std::size_t ideal : ideals_) {
    bool same = true;
    for (std::size_t f = 0; f + 1 < kFactorCount; ++f) {  // all but the executor
      const std::uint32_t level = points_[ideal].level[f];
      const std::uint32_t here = points_[point].level[f];
      same = same && (level == here || level == kNoLevel);  // the ideal depends neither on bounds nor on policies
    }
    if (same) return ideal;
  }
  return std::nullopt;
}

Result<Workload> Factorial::workload_of(const FactorialPoint &point, std::uint64_t repetition) const {
  const std::uint32_t source_level = point.of(FactorKind::Workload);
  const WorkloadSource &source = plan_.workloads[source_level];
  const std::uint32_t workers_level = point.of(FactorKind::Workers);
  const std::uint32_t utilization_level = point.of(FactorKind::Utilization);

  Workload workload = source.workload;
  std::uint32_t workers = source.random ? source.random->workers : workload.platform.workers;
  if (workers_level != kNoLevel) workers = plan_.workers[workers_level];
  const double wanted =
      utilization_level == kNoLevel ? 0 : share(plan_.utilization[utilization_level]) * static_cast<double>(workers);
  if (source.random) {
    lab::GenerateOptions options = *source.random;
    options.workers = workers;
    options.utilization = wanted;
    Result<Workload> drawn = generate(options, derive_seed(plan_.seed, {source_level, repetition}));
    if (!drawn) return drawn;
    workload = std::move(*drawn);
  }
  for (Dag &dag : workload.dags) inherit_periods(dag);
  if (wanted > 0) {
    const double is = mean_utilization(workload);
    if (!(is > 0)) return make_error("the workload has no execution times to scale to a utilization");
    scale_demand(workload, wanted / is);
  }
  if (const std::uint32_t level = point.of(FactorKind::DemandScale); level != kNoLevel) {
    scale_demand(workload, share(plan_.demand_scale[level]));
  }
  if (const std::uint32_t level = point.of(FactorKind::DeadlineScale); level != kNoLevel) {
    scale_deadlines(workload, share(plan_.deadline_scale[level]));
  }
  workload.platform.workers = workers;
  if (const std::uint32_t level = point.of(FactorKind::Policy); level != kNoLevel) {
    workload.policy = plan_.policies[level];
  }
  if (const std::uint32_t level = point.of(FactorKind::MaxActive); level != kNoLevel) {
    const std::vector<std::uint32_t> &bounds = plan_.max_active[level];
    for (std::size_t d = 0; d < workload.dags.size(); ++d) {
      workload.dags[d].max_active = bounds.size() == 1 ? bounds[0] : bounds[d];
    }
  }
  return workload;
}

Result<PlannedRun> Factorial::planned_run(std::uint64_t unit) const {
  const FactorialPoint &point = points_[point_of(unit)];
  Result<Workload> workload = workload_of(point, repetition_of(unit));
  if (!workload) {
    Diagnostics problems = workload.error();
    problems.front().message += fmt::format(" ({})", describe(plan_, point));
    return tl::unexpected<Diagnostics>(std::move(problems));
  }
  if (Diagnostics mistakes = validate(*workload); has_errors(mistakes)) {
    std::erase_if(mistakes, [](const Diagnostic &mistake) { return mistake.severity != Severity::Error; });
    mistakes.front().message += fmt::format(" ({})", describe(plan_, point));
    return tl::unexpected<Diagnostics>(std::move(mistakes));
  }
  PlannedRun run;
  run.workload = std::move(*workload);
  ExecutorPlace place = place_of(plan_, plan_.executors[point.of(FactorKind::Executor)]);
  run.executor = std::move(place.name);
  run.world = place.world;
  run.seed = derive_seed(plan_.seed, {point.of(FactorKind::Workload), repetition_of(unit)});
  run.duration = plan_.duration;
  run.warm_up = plan_.warm_up;
  run.overheads = plan_.overheads;
  if (run.executor == kIdeal || run.executor == kUnlimited) {
    run.world = World::Simulator;
    run.overheads = {};
    run.workload.platform.preemption = PreemptionMode::Os;
    for (Dag &dag : run.workload.dags) dag.max_active = 0;
    if (run.executor == kUnlimited) {
      std::uint32_t most = 0;  // a reentrant task can have several jobs in progress
      for (const TaskRef &ref : flatten(run.workload)) most += ref.task->concurrency;
      run.workload.platform.workers = most;
    }
    run.executor = "redag";
  }
  return run;
}

Result<std::string> Factorial::evaluate(std::uint64_t unit) const {
  const Result<PlannedRun> planned = planned_run(unit);
  if (!planned) return tl::unexpected<Diagnostics>(planned.error());
  Result<FinishedRun> run = drive_(*planned);
  if (!run) {
    Diagnostics problems = std::move(run.error());
    problems.front().message =
        fmt::format("{} ({})", problems.front().message, describe(plan_, points_[point_of(unit)]));
    return tl::unexpected<Diagnostics>(std::move(problems));
  }
  return to_line(observe(*run, ObserveOptions{plan_.paper_startup, plan_.quantiles}));
}

}  // namespace redag::experiment
