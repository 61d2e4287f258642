// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/analyze/admission.hpp"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis {
namespace {

std::string doubtful_tasks(const TaskSet &task_set, const Workload &workload, const Report &report) {
  constexpr std::size_t kMost = 3;
  std::vector<std::string> doubtful;
  for (const TaskRef &ref : flatten(workload)) {
    const auto &response = report.tasks[ref.id.value].response;
    if (response && *response <= ref.task->deadline) continue;
    doubtful.push_back(fmt::format("{} ({}, deadline {})", task_set.tasks[ref.id.value].name,
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
    return make_error(fmt::format("task '{}' of DAG '{}' has no wcet, so its demand is unknown", ref.task->name,
                                  workload.dags[ref.dag.value].name),
                      "state its worst-case execution time");
  }
  const Result<TaskSet> task_set = compile(workload, platform_of(config));
  if (!task_set) return tl::unexpected<Diagnostics>(task_set.error());
  const Report report = analyze(*task_set);
  if (report.verdict == Verdict::Schedulable) return {};
  if (task_set->is_beyond_all()) return make_error(task_set->not_analysable);
  const std::string doubtful = doubtful_tasks(*task_set, workload, report);
  return make_error("no bound shows that every deadline is met" + (doubtful.empty() ? "" : ": " + doubtful),
                    "'redag analyze --explain TASK' shows what a bound consists of");
}

}  // namespace redag::analysis
