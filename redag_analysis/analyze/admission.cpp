// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/admission.hpp"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/system.hpp"

namespace redag::analysis {
namespace {

std::string doubtful_tasks(const System &system, const Workload &workload, const Report &report) {
  constexpr std::size_t kMost = 3;
  std::vector<std::string> doubtful;
  for (const TaskRef &ref : flatten(workload)) {
    const auto &response = report.tasks[ref.id.value].response;
    if (response && *response <= ref.task->deadline) continue;
    doubtful.push_back(fmt::format("{} ({}, deadline {})", system.tasks[ref.id.value].name,
                                   response ? "bound " + humanize_duration(*response) : "no bound",
                                   humanize_duration(ref.task->deadline)));
  }
  const std::size_t count = doubtful.size();
  if (count > kMost) doubtful.resize(kMost);
  return fmt::format("{}{}", fmt::join(doubtful, ", "),
                     count > kMost ? fmt::format(" and {} more", count - kMost) : "");
}

}  // namespace

Result<void> admit_by_bounds(const Workload &workload, const sched::Config &config) {
  for (const TaskRef &ref : flatten(workload)) {
    if (ref.task->wcet > 0) continue;
    return make_error(fmt::format("task '{}' of DAG '{}' has no wcet, so that nothing is known about its share",
                                  ref.task->name, workload.dags[ref.dag.value].name),
                      "state the longest execution time");
  }
  const Result<System> system = compile(workload, platform_of(config));
  if (!system) return tl::unexpected<Diagnostics>(system.error());
  if (!system->not_analysable.empty() && !system->has_modes) return make_error(system->not_analysable);
  const Report report = analyze(*system);
  if (report.verdict == Verdict::Schedulable) return {};
  const std::string doubtful = doubtful_tasks(*system, workload, report);
  return make_error("no bound shows that every deadline is met" + (doubtful.empty() ? "" : ": " + doubtful),
                    "'redag analyze --explain' says where a bound comes from");
}

}  // namespace redag::analysis
