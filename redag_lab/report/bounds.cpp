// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/bounds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/metrics/assumptions.hpp"

namespace redag::report {
namespace {

// With more tasks, the costliest methods take longer than a report is worth.
constexpr std::size_t kMostTasks = 1000;

// Reads "release 2us, dispatch 1us, preempt 0", as the simulator records them, or the overheads of a machine. Returns
// false for any other text.
bool read_overheads(std::string_view text, analysis::AnalysisPlatform &platform) {
  if (const std::optional<Overheads> machine = parse_overheads(text)) {
    platform = analysis::charge(platform, *machine);
    return true;
  }
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(", "), text.size());
    const std::string_view part = text.substr(0, comma);
    text.remove_prefix(std::min(text.size(), comma + 2));
    const std::size_t blank = part.find(' ');
    if (blank == std::string_view::npos) return false;
    const Result<Duration> value = parse_duration(part.substr(blank + 1));
    const std::string_view what = part.substr(0, blank);
    Duration *target = what == "release"    ? &platform.release_overhead
                       : what == "dispatch" ? &platform.dispatch_overhead
                       : what == "preempt"  ? &platform.preempt_overhead
                                            : nullptr;
    if (!value || target == nullptr) return false;
    *target = *value;
  }
  return true;
}

std::string describe(const analysis::AnalysisPlatform &platform, const trace::RunInfo &run) {
  const bool is_real = run.driver != trace::Driver::Simulator;
  const std::string none = is_real ? metrics::not_calibrated_hint() : "no overheads";
  return fmt::format("{} worker{}, {} preemption, {}", platform.workers, platform.workers == 1 ? "" : "s",
                     trace::preemption_name(platform.preemption),
                     run.overheads.empty() ? none
                     : is_real             ? "with the overheads of the machine"
                                           : "overheads " + run.overheads);
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
  const sched::ExecutorKind *executor = sched::find_executor(run.executor);
  if (executor == nullptr) return none("there is no analysis of the executor '" + run.executor + "'");
  if (run.workload.task_count() > kMostTasks) {
    return none(fmt::format("more than {} tasks: 'redag analyze' takes its time for them", kMostTasks));
  }
  analysis::AnalysisPlatform platform = analysis::platform_of(run.config);
  if (!read_overheads(run.overheads, platform)) return none("the run's overheads are not understood: " + run.overheads);
  Workload workload = run.workload;
  workload.policy = run.config.policy;
  workload.ties = run.config.ties;
  const Result<analysis::System> system = analysis::compile_for(*executor, workload, platform);
  if (!system) return none(system.error().front().message);

  const analysis::Report report = analysis::analyze(*system, analysis::methods_of(*executor));
  RunBounds bounds;
  bounds.assumes = describe(platform, run);
  bounds.tasks = by_id(report.tasks);
  bounds.dags = by_id(report.dags);
  bounds.schedulable = report.verdict == analysis::Verdict::Schedulable;
  for (const analysis::Method *method : report.by) bounds.by.emplace_back(method->name);
  const auto bounded = [](const BoundOf &bound) { return bound.response.has_value(); };
  if (!bounds.schedulable && std::none_of(bounds.tasks.begin(), bounds.tasks.end(), bounded)) {
    bounds.absent = system->not_analysable.empty() ? "no sound method bounds a response here; 'redag analyze' says why"
                                                   : system->not_analysable;
  }
  return bounds;
}

}  // namespace redag::report
