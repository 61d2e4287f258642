// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/bound_check.hpp"

#include <fmt/format.h>

#include "redag_lab/search/analysed.hpp"

namespace redag::lab {

BoundCheck check_bounds(const Session &session) {
  BoundCheck check;
  const trace::RunInfo &info = session.info;
  const Workload &workload = info.workload;
  const Result<std::vector<AnalysedPart>> analysed =
      analysis::as_executed(workload, info.config, info.overheads).and_then([&](const analysis::ExecutedRun &run) {
        return analyse_parts(run.workload, run.platform, info.executor);
      });
  std::vector<Duration> bounds(workload.task_count(), 0);
  check.methods.resize(bounds.size());
  for (const TaskRef &ref : flatten(workload)) {
    check.names.push_back(trace::task_name(workload, ref.id));
    check.wcets.push_back(ref.task->wcet);
  }
  if (!analysed) check.absent = to_string(analysed.error());
  for (const AnalysedPart &one : analysed ? *analysed : std::vector<AnalysedPart>()) {
    const std::vector<Row> rows = task_rows(one.analysed);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::size_t t = one.part.tasks[i].value;
      const analysis::Tightest &bound = one.analysed.report.tasks[i];
      if (bound.response) {
        ++check.bounded;
        bounds[t] = *bound.response;
        check.methods[t] = std::string(bound.method->name);
      } else if (check.absent.empty()) {
        check.absent = fmt::format("{}: {}", check.names[t], rows[i].reason);
      }
    }
  }
  check.assumptions =
      metrics::check_assumptions(info, session.trace.events, [&](TaskId task) { return bounds[task.value]; });
  check.remarks = metrics::remarks(check.assumptions, workload);
  return check;
}

}  // namespace redag::lab
