// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial_recorded.hpp"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "redag/model/workload_yaml.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_lab/experiment/factorial.hpp"

namespace redag::experiment {
namespace {

Result<FinishedRun> no_driver(const PlannedRun & /*run*/) {
  return make_error("recorded runs can only be added to an experiment, not run");
}

// Returns the text that identifies a workload's jobs. It ignores names, platform and policy.
std::string jobs_of(Workload workload) {
  for (Dag &dag : workload.dags) inherit_periods(dag);
  workload.name = "any";
  workload.platform = {};
  workload.policy = {};
  for (Dag &dag : workload.dags) dag.max_active = 0;  // rclcpp's executors ignore it
  return to_yaml(workload);
}

std::string executor_of(const RecordedRun &run) { return std::string("ros2/") + run.info.executor; }

Result<void> fits(const FactorialPlan &plan, const RecordedRun &run) {
  if (run.info.driver != trace::Driver::RosNodes) {
    return make_error(fmt::format("{}: this is not a run of ROS 2 nodes", run.file),
                      "run_workload of redag_rclcpp_lab records such runs");
  }
  const auto differ = [&](const char *what, Duration is, Duration planned) {
    return make_error(fmt::format("{}: its {} is {}, but {} in the plan", run.file, what, format_duration(is),
                                  format_duration(planned)),
                      "only runs of the same length can be compared");
  };
  const Duration length = run.info.end - run.info.start;
  if (length != plan.duration) return differ("duration", length, plan.duration);
  if (run.info.warm_up != plan.warm_up) return differ("warm-up", run.info.warm_up, plan.warm_up);
  return {};
}

}  // namespace

RecordedRun record(std::string file, const trace::Trace &trace, const FactorialPlan &plan) {
  FinishedRun run;
  run.trace = trace;
  run.summary = metrics::summarize(trace);
  run.check = metrics::check_trace(trace, metrics::rules_for(trace.info));
  return {std::move(file), trace.info, to_line(observe(run, {plan.paper_startup, plan.quantiles}))};
}

Result<FactorialUnits> with_recorded(FactorialUnits units, const std::vector<RecordedRun> &runs) {
  FactorialUnits all;
  all.plan = units.plan;
  for (const RecordedRun &run : runs) {
    if (Result<void> fitting = fits(all.plan, run); !fitting) {
      return tl::unexpected<Diagnostics>(std::move(fitting.error()));
    }
    const std::string executor = executor_of(run);
    std::vector<std::string> &known = all.plan.executors;
    if (std::find(known.begin(), known.end(), executor) == known.end()) known.push_back(executor);
  }

  // New executors are last in the list. Levels keep their numbers, but points get others.
  const Factorial before(units.plan, no_driver);
  const Factorial after(all.plan, no_driver);
  std::map<std::vector<std::uint32_t>, std::uint64_t> number;
  for (std::size_t p = 0; p < after.points().size(); ++p) number[after.points()[p].level] = p;
  const std::uint64_t count = after.points().size();
  std::set<std::uint64_t> taken;
  for (FinishedUnit &unit : units.units) {
    const FactorialPoint &point = before.points()[before.point_of(unit.unit)];
    unit.unit = before.repetition_of(unit.unit) * count + number.at(point.level);
    taken.insert(unit.unit);
    all.units.push_back(std::move(unit));
  }

  std::map<std::uint64_t, std::string> jobs;  // by unit; each is computed once
  for (const RecordedRun &run : runs) {
    const std::string wanted = jobs_of(run.info.workload);
    bool known = false;
    bool placed = false;
    for (std::uint64_t unit = 0; unit < after.unit_count() && !placed; ++unit) {
      const FactorialPoint &point = after.points()[after.point_of(unit)];
      if (all.plan.executors[point.of(FactorKind::Executor)] != executor_of(run)) continue;
      const std::uint32_t workers = point.of(FactorKind::Workers);
      if (workers != kNoLevel && all.plan.workers[workers] != run.info.workload.platform.workers) continue;
      if (!jobs.contains(unit)) {
        const Result<PlannedRun> planned = after.planned_run(unit);
        if (!planned) return tl::unexpected<Diagnostics>(planned.error());
        jobs[unit] = jobs_of(planned->workload);
      }
      if (jobs[unit] != wanted) continue;
      known = true;
      if (!taken.insert(unit).second) continue;
      all.units.push_back({unit, run.result});
      placed = true;
    }
    if (!placed && known) {
      return make_error(fmt::format("{}: there are more runs of '{}' than the {} repetitions of the plan", run.file,
                                    executor_of(run), all.plan.repetitions));
    }
    if (!placed) return make_error(fmt::format("{}: no combination of the plan has the jobs of this run", run.file));
  }
  std::sort(all.units.begin(), all.units.end(),
            [](const FinishedUnit &a, const FinishedUnit &b) { return a.unit < b.unit; });
  return all;
}

}  // namespace redag::experiment
