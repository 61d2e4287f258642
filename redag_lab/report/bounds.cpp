// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/bounds.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/metrics/assumptions.hpp"

namespace redag::report {
namespace {

// With more tasks, the costliest methods take longer than a report is worth.
constexpr std::size_t kMostTasks = 1000;

std::string describe(const analysis::AnalysisPlatform &platform, const trace::RunInfo &run) {
  const bool is_real = run.driver != trace::Driver::Simulator;
  const std::string none = is_real ? metrics::not_calibrated_hint() : "no overheads";
  return fmt::format("{} worker{}, {} preemption, {}", platform.workers, platform.workers == 1 ? "" : "s",
                     trace::preemption_name(platform.preemption),
                     run.overheads.empty() ? none
                     : is_real             ? "charged with the machine's overheads"
                                           : "charged with overheads " + run.overheads);
}

RunBounds none(std::string why) {
  RunBounds bounds;
  bounds.absent = std::move(why);
  return bounds;
}

std::vector<BoundOf> by_id(const std::vector<analysis::Tightest> &all) {
  std::vector<BoundOf> bounds;
  bounds.reserve(all.size());
  for (const analysis::Tightest &one : all) {
    bounds.push_back({one.response, one.response ? std::string(one.method->name) : std::string()});
  }
  return bounds;
}

}  // namespace

RunBounds bounds_of(const trace::RunInfo &run) {
  const executors::ExecutorKind *executor = executors::find_executor(run.executor);
  if (executor == nullptr) return none("there is no analysis for the executor '" + run.executor + "'");
  if (run.workload.task_count() > kMostTasks) {
    return none(fmt::format("there are more than {} tasks, which takes long: run 'redag analyze' for their bounds",
                            kMostTasks));
  }
  const auto executed = analysis::as_executed(run.workload, run.config, run.overheads);
  if (!executed) return none(executed.error().front().message);
  const auto task_set = analysis::compile_for(*executor, executed->workload, executed->platform);
  if (!task_set) return none(task_set.error().front().message);

  const analysis::Report report = analysis::analyze(*task_set, analysis::methods_of(*executor));
  RunBounds bounds;
  bounds.assumes = describe(executed->platform, run);
  bounds.tasks = by_id(report.tasks);
  bounds.dags = by_id(report.dags);
  bounds.schedulable = report.verdict == analysis::Verdict::Schedulable;
  for (const analysis::Method *method : report.by) bounds.by.emplace_back(method->name);
  const auto bounded = [](const BoundOf &bound) { return bound.response.has_value(); };
  if (!bounds.schedulable && std::none_of(bounds.tasks.begin(), bounds.tasks.end(), bounded)) {
    bounds.absent = task_set->not_analysable.empty()
                        ? "no sound method bounds a response time here; 'redag analyze' shows why"
                        : task_set->not_analysable;
  }
  return bounds;
}

}  // namespace redag::report
