// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/bounds.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/search/analysed.hpp"

namespace redag::report {
namespace {

// With more tasks, the costliest methods take longer than a report is worth.
constexpr std::size_t kMostTasks = 1000;

std::string describe(const analysis::AnalysisPlatform &platform, const trace::RunInfo &run) {
  const bool is_real = run.driver != trace::Driver::Simulator;
  const std::string none = is_real ? metrics::not_calibrated_hint() : "no overheads";
  const std::size_t clusters = run.workload.platform.clusters.size();
  return fmt::format("{}{}, {} preemption, {}", plural(platform.workers, "worker"),
                     clusters == 0 ? "" : " in " + plural(clusters, "cluster"),
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

// Writes the bounds of one cluster to the places that `ids` name.
template <class Id>
void take(const std::vector<analysis::Tightest> &all, const std::vector<Id> &ids, std::vector<BoundOf> &bounds) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    const analysis::Tightest &one = all[i];
    bounds[ids[i].value] = {one.response, one.response ? std::string(one.method->name) : std::string()};
  }
}

}  // namespace

RunBounds bounds_of(const trace::RunInfo &run) {
  if (run.workload.task_count() > kMostTasks) {
    return none(fmt::format("there are more than {} tasks, which takes long: run 'redag analyze' for their bounds",
                            kMostTasks));
  }
  const auto executed = analysis::as_executed(run.workload, run.config, run.overheads);
  if (!executed) return none(executed.error().front().message);
  const auto parts = lab::analyse_parts(executed->workload, executed->platform, run.executor);
  if (!parts) return none(parts.error().front().message);
  RunBounds bounds;
  bounds.assumes = describe(executed->platform, run);
  bounds.tasks.resize(run.workload.task_count());
  bounds.dags.resize(run.workload.dags.size());
  bounds.schedulable = lab::is_schedulable(*parts);
  std::string not_analysable;
  for (const auto &[part, analysed] : *parts) {
    take(analysed.report.tasks, part.tasks, bounds.tasks);
    take(analysed.report.dags, part.dags, bounds.dags);
    for (const analysis::Method *method : analysed.report.by) {
      if (std::find(bounds.by.begin(), bounds.by.end(), method->name) == bounds.by.end()) {
        bounds.by.emplace_back(method->name);
      }
    }
    if (not_analysable.empty()) not_analysable = analysed.task_set.not_analysable;
  }
  const auto bounded = [](const BoundOf &bound) { return bound.response.has_value(); };
  if (!bounds.schedulable && std::none_of(bounds.tasks.begin(), bounds.tasks.end(), bounded)) {
    bounds.absent = not_analysable.empty() ? "no sound method bounds a response time here; 'redag analyze' shows why"
                                           : not_analysable;
  }
  return bounds;
}

}  // namespace redag::report
