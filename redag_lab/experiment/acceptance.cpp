// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance.hpp"

#include <algorithm>
#include <limits>
#include <span>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/derived/rng.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::experiment {
namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
constexpr std::size_t kMostViolations = 20;  // named in the results

enum Place : std::size_t { kAtDags, kAtWorkers, kAtPreemption, kAtUtilization };  // of factors_of()

char verdict_of(const analysis::MethodReport &report) {
  if (report.bound() == nullptr) return kNotApplicable;
  if (report.verdict != analysis::Verdict::Schedulable) return kNotAccepted;
  return report.trusted ? kAccepted : kAcceptedUnsound;
}

// Makes the deadlines of DAGs with edges end to end. The analysis treats tasks joined by edges as one unit and holds
// the whole DAG to its deadline; the workload does the same.
void make_deadlines_end_to_end(Workload &workload) {
  for (Dag &dag : workload.dags) {
    const auto source = std::find_if(dag.tasks.begin(), dag.tasks.end(),
                                     [](const Task &task) { return task.activation == Activation::Timer; });
    const bool has_edges =
        std::any_of(dag.tasks.begin(), dag.tasks.end(), [](const Task &task) { return !task.predecessors.empty(); });
    REDAG_CHECK(source != dag.tasks.end(), "a DAG has a source");
    if (!has_edges) continue;
    dag.deadline = source->deadline;
    for (Task &task : dag.tasks) task.deadline = std::max(task.wcet, dag.deadline);
  }
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

bool sees_miss(const Workload &workload, const analysis::TaskSet &task_set, const SimulationEffort &effort,
               std::uint64_t seed) {
  Duration slowest = 0;
  for (const analysis::CompiledTask &task : task_set.tasks) slowest = std::max(slowest, task.period);
  const sched::Config config = sched::config_of(workload);
  Workload worst = at_worst(workload);
  for (std::uint32_t i = 0; i <= effort.offsets; ++i) {
    sim::Options options;
    options.horizon = slowest * (effort.periods + (i > 0 ? 1 : 0));
    options.seed = derive_seed(seed, {i});
    if (i > 0) {
      Rng rng(options.seed);
      draw_offsets(worst, task_set, rng);
    }
    sched::PriorityScheduler scheduler(worst, config);
    metrics::DeadlineWatch watch(worst);
    bool missed = false;
    const auto see = [&missed](const metrics::JudgedJob &job) { missed = missed || job.miss != metrics::Miss::None; };
    const sim::Result result =
        sim::simulate(worst, scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
          watch.add(events, see);
          return !missed;
        });
    watch.finish(result.end, see);
    if (missed) return true;
  }
  return false;
}

std::vector<Factor> factors_of(const AcceptancePlan &plan) {
  const auto number = [](auto value) { return fmt::format("{}", value); };
  const auto name = [](auto value) { return to_string(value); };
  return {{"dags", texts(plan.dags, number), true},
          {"workers", texts(plan.workers, number), true},
          {"preemption", texts(plan.preemption, name), false},
          {"utilization", texts(plan.utilization, [&](std::uint32_t u) { return number(share(u)); }), true}};
}

lab::GenerateOptions generate_options(const AcceptancePlan &plan, const Point &point) {
  lab::GenerateOptions options = plan.workload;
  options.dags = plan.dags[point[kAtDags]];
  options.workers = plan.workers[point[kAtWorkers]];
  options.preemption = plan.preemption[point[kAtPreemption]];
  options.utilization = static_cast<double>(plan.utilization[point[kAtUtilization]]) * options.workers / kMillion;
  return options;
}

Acceptance::Acceptance(AcceptancePlan plan)
    : plan_(std::move(plan)),
      factors_(factors_of(plan_)),
      points_(points_of(factors_, [](std::size_t, const Point &) { return true; })),
      sets_(points_.size()),
      counts_(points_.size(), std::vector<Count>(plan_.methods.size())) {
  for (std::size_t i = 0; i < plan_.methods.size(); ++i) {
    const std::string &name = plan_.methods[i];
    const auto &known = analysis::methods();
    const auto found =
        std::find_if(known.begin(), known.end(), [&](const analysis::Method &method) { return method.name == name; });
    registered_.push_back(found == known.end() ? kNone : static_cast<std::size_t>(found - known.begin()));
    if (name == kSimulationMethod) simulation_ = i;
    any_ = any_ || name == kAnyMethod;
    REDAG_CHECK(found != known.end() || name == kSimulationMethod || name == kAnyMethod, "a plan without mistakes");
  }
}

std::uint64_t Acceptance::seed_of(std::uint64_t unit) const {
  const Point &point = points_[unit % points_.size()];
  constexpr std::uint64_t kImplicitDeadlines = 0;  // without this coordinate, every seed would draw other workloads
  return derive_seed(plan_.seed, {plan_.dags[point[kAtDags]], plan_.workers[point[kAtWorkers]], kImplicitDeadlines,
                                  plan_.utilization[point[kAtUtilization]], unit / points_.size()});
}

Result<Workload> Acceptance::draw(std::uint64_t unit) const {
  const Point &point = points_[unit % points_.size()];
  Result<Workload> workload = generate(generate_options(plan_, point), seed_of(unit));
  if (workload) {
    make_deadlines_end_to_end(*workload);
  } else {
    workload.error().front().message += fmt::format(" ({})", describe(factors_, point));
  }
  return workload;
}

Result<std::string> Acceptance::evaluate(std::uint64_t unit) const {
  const Result<Workload> workload = draw(unit);
  if (!workload) return tl::unexpected<Diagnostics>(workload.error());
  const Result<analysis::TaskSet> task_set = analysis::compile(*workload, analysis::platform_of(*workload));
  if (!task_set) return tl::unexpected<Diagnostics>(task_set.error());

  // `any` needs all methods, in the order of the registry. Otherwise only the plan's methods run.
  std::vector<analysis::Method> chosen;
  if (any_) chosen = analysis::methods();
  for (const std::size_t index : registered_) {
    if (!any_ && index != kNone) chosen.push_back(analysis::methods()[index]);
  }
  const analysis::Report report = analysis::analyze(*task_set, chosen);
  std::string result;
  std::size_t next = 0;
  for (std::size_t i = 0; i < plan_.methods.size(); ++i) {
    if (registered_[i] != kNone) {
      result += verdict_of(report.methods[any_ ? registered_[i] : next++]);
    } else if (i == simulation_) {
      result += sees_miss(*workload, *task_set, plan_.simulation, seed_of(unit)) ? kNotAccepted : kAccepted;
    } else {
      result += report.verdict == analysis::Verdict::Schedulable ? kAccepted : kNotAccepted;
    }
  }
  return result;
}

Result<void> Acceptance::add(std::uint64_t unit, const std::string &result) {
  if (unit >= unit_count() || result.size() != plan_.methods.size() ||
      result.find_first_not_of("10-u") != std::string::npos) {
    return make_error(fmt::format("the plan has no unit {} with result '{}'", unit, result));
  }
  ++sets_[unit % points_.size()];
  for (std::size_t m = 0; m < result.size(); ++m) {
    Count &count = counts_[unit % points_.size()][m];
    if (result[m] == kAccepted || result[m] == kAcceptedUnsound) ++count.accepted;
    if (result[m] == kAcceptedUnsound) ++count.unsound;
    if (result[m] == kNotApplicable) ++count.not_applicable;
  }
  if (!broken_by(result).empty()) violations_.emplace_back(unit, result);
  return {};
}

Result<Results> Acceptance::results() const {
  Results results;
  results.name = plan_.name;
  results.units_are = "workloads";
  results.factors = factors_;
  results.factors.push_back({"method", plan_.methods, false});
  results.counts = {"sets", "accepted", "unsound", "not_applicable"};
  results.figures = {"accepted_ratio"};
  results.units = unit_count();
  for (std::size_t p = 0; p < points_.size(); ++p) {
    results.done += sets_[p];
    for (std::size_t m = 0; m < plan_.methods.size() && sets_[p] > 0; ++m) {
      const Count &count = counts_[p][m];
      ResultRow row{points_[p], {}, {sets_[p], count.accepted, count.unsound, count.not_applicable}, {std::nullopt}};
      row.point.push_back(static_cast<std::uint32_t>(m));
      if (count.not_applicable < sets_[p]) row.figures[0] = proportion(count.accepted, sets_[p]);
      results.rows.push_back(std::move(row));
    }
  }
  auto violations = violations_;
  std::sort(violations.begin(), violations.end());
  if (violations.empty() && simulation_) {
    results.remarks.push_back({true, "No sound method accepted a workload that missed a deadline in simulation."});
  }
  for (const auto &[unit, result] : violations) {
    if (results.remarks.size() == kMostViolations) break;
    results.remarks.push_back(
        {false, fmt::format("unit {} ({}) misses a deadline in simulation, although it is accepted by {}", unit,
                            describe(factors_, points_[unit % points_.size()]), fmt::join(broken_by(result), ", "))});
  }
  return results;
}

std::vector<std::string> Acceptance::broken_by(std::string_view result) const {
  std::vector<std::string> methods;
  if (!simulation_ || result[*simulation_] == kAccepted) return methods;
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (result[i] == kAccepted) methods.push_back(plan_.methods[i]);
  }
  return methods;
}

}  // namespace redag::experiment
