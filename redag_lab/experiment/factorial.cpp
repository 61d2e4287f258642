// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag/loader/validate.hpp"

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

// True of a figure that is the largest of all repetitions, not their median.
bool is_maximum(std::size_t figure) {
  return figure == kMaxLateness || figure == kPaperMaxLateness || figure == kResponseMax;
}

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
      points_(points_of(plan_)),
      runs_(points_.size()) {}

bool Factorial::takes_turns() const {
  return std::any_of(plan_.executors.begin(), plan_.executors.end(), [this](const std::string &executor) {
    const auto [world, name] = place_of(plan_, executor);
    return world != World::Simulator && name != kIdeal && name != kUnlimited;
  });
}

void Factorial::arrange(std::vector<std::uint64_t> &units) const {
  const auto turn = [count = points_.size()](std::uint64_t unit) {
    const std::uint64_t repetition = unit / count;
    return repetition * count + (unit % count + count - repetition % count) % count;
  };
  std::sort(units.begin(), units.end(), [&](std::uint64_t a, std::uint64_t b) { return turn(a) < turn(b); });
}

Result<Workload> Factorial::workload_of(const Point &point, std::uint64_t repetition) const {
  const std::uint32_t source_level = point[kWorkload];
  const WorkloadSource &source = plan_.workloads[source_level];
  const std::uint32_t workers_level = point[kWorkers];
  const std::uint32_t utilization_level = point[kUtilization];

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
  if (const std::uint32_t level = point[kDemandScale]; level != kNoLevel) {
    scale_demand(workload, share(plan_.demand_scale[level]));
  }
  if (const std::uint32_t level = point[kDeadlineScale]; level != kNoLevel) {
    scale_deadlines(workload, share(plan_.deadline_scale[level]));
  }
  workload.platform.workers = workers;
  if (const std::uint32_t level = point[kPolicy]; level != kNoLevel) {
    workload.policy = plan_.policies[level];
  }
  if (const std::uint32_t level = point[kMaxActive]; level != kNoLevel) {
    const std::vector<std::uint32_t> &bounds = plan_.max_active[level];
    for (std::size_t d = 0; d < workload.dags.size(); ++d) {
      workload.dags[d].max_active = bounds.size() == 1 ? bounds[0] : bounds[d];
    }
  }
  return workload;
}

Result<PlannedRun> Factorial::planned_run(std::uint64_t unit) const {
  const Point &point = points_[unit % points_.size()];
  const std::uint64_t repetition = unit / points_.size();
  Result<Workload> workload = workload_of(point, repetition);
  Diagnostics mistakes = workload ? validate(*workload) : workload.error();
  std::erase_if(mistakes, [](const Diagnostic &mistake) { return mistake.severity != Severity::Error; });
  if (!mistakes.empty()) {
    mistakes.front().message += fmt::format(" ({})", describe(factors_, point));
    return tl::unexpected<Diagnostics>(std::move(mistakes));
  }
  PlannedRun run;
  run.workload = std::move(*workload);
  ExecutorPlace place = place_of(plan_, plan_.executors[point[kExecutor]]);
  run.executor = std::move(place.name);
  run.world = place.world;
  run.seed = derive_seed(plan_.seed, {point[kWorkload], repetition});
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
    run.error().front().message += fmt::format(" ({})", describe(factors_, points_[unit % points_.size()]));
    return tl::unexpected<Diagnostics>(std::move(run.error()));
  }
  return to_line(observe(*run));
}

Result<void> Factorial::add(std::uint64_t unit, const std::string &result) {
  Result<Observation> seen =
      unit < unit_count() ? parse_observation(result) : Result<Observation>(make_error("the plan has no such unit"));
  if (!seen) return make_error(fmt::format("unit {}: {}", unit, seen.error().front().message));
  Runs &runs = runs_[unit % points_.size()];
  runs.resize(plan_.repetitions);
  runs[unit / points_.size()] = std::move(*seen);
  return {};
}

// Returns the runs of `ideal` with the same jobs and workers; null if the plan has none.
const Factorial::Runs *Factorial::ideal_of(const Point &point) const {
  for (std::size_t p = 0; p < points_.size(); ++p) {
    if (plan_.executors[points_[p][kExecutor]] != kIdeal) continue;
    bool same = true;
    for (std::size_t f = 0; f < kExecutor; ++f) {
      const std::uint32_t level = points_[p][f];  // none of bounds and policies, on which the ideal does not depend
      same = same && (level == point[f] || level == kNoLevel);
    }
    if (same) return &runs_[p];
  }
  return nullptr;
}

ResultRow Factorial::row_of(std::size_t point, std::size_t dag, const Runs *ideal) const {
  ResultRow row{points_[point], {}, {0, 0, 0}, {}};
  std::array<std::vector<double>, kFigureCount> values;
  for (std::size_t r = 0; r < runs_[point].size(); ++r) {
    if (!runs_[point][r]) continue;
    const Observation &run = *runs_[point][r];
    const DagObservation &seen = run.dags[dag];
    row.labels = {run.world, run.preemption, seen.dag};
    row.counts[0] += seen.released;
    row.counts[1] += seen.missed;
    ++row.counts[2];
    for (std::size_t f = 0; f < kFigureCount; ++f) {
      if (seen.figures[f]) values[f].push_back(*seen.figures[f]);
    }
    if (ideal == nullptr || r >= ideal->size() || !(*ideal)[r]) continue;
    values[kExcessMissRatio].push_back(*seen.figures[kMissRatio] - *(*ideal)[r]->dags[dag].figures[kMissRatio]);
  }
  for (std::size_t f = 0; f < kFigureCount; ++f) {
    row.figures.emplace_back();
    if (values[f].empty()) continue;
    row.figures[f] = median_of(values[f]);
    if (!is_maximum(f)) continue;
    const auto [least, largest] = std::minmax_element(values[f].begin(), values[f].end());
    row.figures[f] = Interval{*largest, *least, *largest, row.figures[f]->confidence};
  }
  return row;
}

Result<Results> Factorial::results() const {
  Results results;
  results.name = plan_.name;
  results.units_are = "runs";
  results.factors = factors_;
  results.labels = {"world", "preemption", "dag"};
  results.counts = {"released", "missed", "repetitions"};
  results.figures.assign(kFigureNames.begin(), kFigureNames.end());
  results.units = unit_count();
  std::uint64_t violations = 0;
  std::uint64_t checks = 0;
  std::uint64_t unenforced = 0;
  for (std::size_t p = 0; p < points_.size(); ++p) {
    std::size_t dags = 0;
    for (const std::optional<Observation> &run : runs_[p]) {
      if (!run) continue;
      ++results.done;
      violations += run->violations;
      checks += run->checks;
      if (!run->enforced) ++unenforced;
      dags = run->dags.size();
    }
    const Runs *ideal = ideal_of(points_[p]);
    for (std::size_t dag = 0; dag < dags; ++dag) results.rows.push_back(row_of(p, dag, ideal));
  }
  results.remarks.push_back(
      {violations == 0,
       fmt::format("{} runs, {} checks of their traces: {} of the model.", format_count(results.done),
                   format_count(checks), violations == 0 ? "no violation" : format_count(violations) + " VIOLATIONS")});
  results.remarks.push_back({unenforced == 0, unenforced == 0 ? "Every max_active bound was kept."
                                                              : fmt::format("max_active was EXCEEDED in {} runs.",
                                                                            format_count(unenforced))});
  return results;
}

}  // namespace redag::experiment
