// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/experiment/seed.hpp"
#include "redag_lab/experiment/simulated_misses.hpp"

namespace redag::experiment {
namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

std::uint64_t workload_seed(const AcceptancePlan &plan, const AcceptancePoint &point, std::uint64_t repetition) {
  return derive_seed(plan.seed, {point.dags, point.workers, static_cast<std::uint64_t>(point.deadlines),
                                 point.utilization, repetition});
}

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

}  // namespace

std::string describe(const AcceptancePoint &point) {
  return fmt::format("{} DAGs, {} workers, {} deadlines, preemption {}, utilization {}", point.dags, point.workers,
                     to_string(point.deadlines), to_string(point.preemption),
                     point.utilization / static_cast<double>(kMillion));
}

std::uint64_t unit_count(const AcceptancePlan &plan) { return points_of(plan).size() * plan.sets; }

lab::GenerateOptions generate_options(const AcceptancePlan &plan, const AcceptancePoint &point) {
  lab::GenerateOptions options = plan.workload;
  options.dags = point.dags;
  options.workers = point.workers;
  options.preemption = point.preemption;
  options.utilization = static_cast<double>(point.utilization) * point.workers / kMillion;
  options.deadline_min = point.deadlines == DeadlineKind::Implicit ? 1.0 : 0.5;
  options.deadline_max = 1.0;
  return options;
}

Result<Workload> draw_workload(const AcceptancePlan &plan, const AcceptancePoint &point, std::uint64_t repetition) {
  Result<Workload> workload = generate(generate_options(plan, point), workload_seed(plan, point, repetition));
  if (workload) make_deadlines_end_to_end(*workload);
  return workload;
}

Acceptance::Acceptance(AcceptancePlan plan) : plan_(std::move(plan)), points_(points_of(plan_)) {
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

Result<std::string> Acceptance::evaluate(std::uint64_t unit) const {
  const AcceptancePoint &point = point_of(unit);
  const std::uint64_t repetition = unit / points_.size();
  const Result<Workload> workload = draw_workload(plan_, point, repetition);
  if (!workload) {
    Diagnostics mistakes = workload.error();
    mistakes.front().message += fmt::format(" ({}, repetition {})", describe(point), repetition);
    return tl::unexpected<Diagnostics>(std::move(mistakes));
  }
  const Result<analysis::TaskSet> task_set = analysis::compile(*workload, analysis::platform_of(*workload));
  if (!task_set) return tl::unexpected<Diagnostics>(task_set.error());

  // `any` needs all methods, in the order of the registry. Otherwise only the plan's methods run.
  std::vector<analysis::Method> chosen;
  for (const std::size_t index : registered_) {
    if (!any_ && index != kNone) chosen.push_back(analysis::methods()[index]);
  }
  const analysis::Report report = any_ ? analysis::analyze(*task_set) : analysis::analyze(*task_set, chosen);
  std::string result;
  std::size_t next = 0;
  for (std::size_t i = 0; i < plan_.methods.size(); ++i) {
    if (registered_[i] != kNone) {
      result += verdict_of(report.methods[any_ ? registered_[i] : next++]);
    } else if (i == simulation_) {
      const std::uint64_t seed = workload_seed(plan_, point, repetition);
      result += find_miss(*workload, *task_set, plan_.simulation, seed) ? kNotAccepted : kAccepted;
    } else {
      result += report.verdict == analysis::Verdict::Schedulable ? kAccepted : kNotAccepted;
    }
  }
  return result;
}

bool Acceptance::is_result(std::string_view result) const {
  return result.size() == plan_.methods.size() && result.find_first_not_of("10-u") == std::string_view::npos;
}

std::vector<std::string> Acceptance::broken_by(std::string_view result) const {
  std::vector<std::string> methods;
  if (!simulation_ || result[*simulation_] == kAccepted) return methods;
  for (std::size_t i = 0; i < result.size(); ++i) {
    if (result[i] == kAccepted) methods.push_back(plan_.methods[i]);
  }
  return methods;
}

Result<std::string> Acceptance::replay(std::uint64_t unit, std::string_view result) const {
  const AcceptancePoint &point = point_of(unit);
  const std::uint64_t repetition = unit / points_.size();
  const Result<Workload> workload = draw_workload(plan_, point, repetition);
  if (!workload) return tl::unexpected<Diagnostics>(workload.error());
  const Result<analysis::TaskSet> task_set = analysis::compile(*workload, analysis::platform_of(*workload));
  if (!task_set) return tl::unexpected<Diagnostics>(task_set.error());
  const std::uint64_t seed = workload_seed(plan_, point, repetition);
  const std::optional<SeenMiss> miss = find_miss(*workload, *task_set, plan_.simulation, seed);
  if (!miss) return make_error(fmt::format("unit {}: the miss did not occur again", unit));
  return fmt::format(
      "# unit {} of '{}': {}, repetition {}; workload seed {}\n"
      "# accepted by: {}\n"
      "# seen: {}\n"
      "# redag simulate THIS_FILE --duration {} --seed {}\n{}",
      unit, plan_.name, describe(point), repetition, seed, fmt::join(broken_by(result), ", "), miss->what,
      format_duration(miss->duration), miss->seed, to_yaml(miss->workload));
}

}  // namespace redag::experiment
