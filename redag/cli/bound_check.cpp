#include "redag/cli/bound_check.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/analysis/analyze.hpp"
#include "redag/cli/analysis_report.hpp"
#include "redag/cli/table.hpp"
#include "redag/metrics/bound_watch.hpp"

namespace redag::cli {

BoundCheck check_bounds(const Session &session) {
  BoundCheck check;
  const trace::RunInfo &info = session.info;
  Workload workload = info.workload;
  workload.policy = info.config.policy;
  const Result<Analysed> analysed = analyse(workload, analysis::platform_of(info.config), nullptr, info.executor);
  if (!analysed) {
    check.absent = to_string(analysed.error());
    return check;
  }
  const std::vector<analysis::Tightest> &bounds = analysed->report.tasks;
  metrics::BoundWatch watch;
  watch.add(session.trace.events, [&](TaskId task) { return bounds[task.value].response.value_or(0); });

  const std::vector<Row> analysed_rows = task_rows(*analysed);
  for (const TaskRef &ref : flatten(workload)) {
    const analysis::Tightest &bound = bounds[ref.id.value];
    BoundCheck::Row row;
    row.name = trace::task_name(workload, ref.id);
    row.wcet = ref.task->wcet;
    const metrics::Distribution &on_worker = session.summary.tasks[ref.id.value].jobs.on_worker;
    if (on_worker.count > 0 && on_worker.max > row.wcet) row.on_worker = on_worker.max;
    if (bound.response) {
      ++check.bounded;
      row.bound = *bound.response;
      row.method = std::string(bound.method->name);
    } else if (check.absent.empty()) {
      check.absent = fmt::format("{}: {}", row.name, analysed_rows[ref.id.value].reason);
    }
    if (const metrics::BoundCount *count = watch.of(ref.id)) {
      row.exceeded = count->exceeded;
      row.worst = count->worst;
    }
    if (row.bound > 0 || row.on_worker > 0) check.rows.push_back(std::move(row));
  }
  return check;
}

std::string describe(const BoundCheck &check, std::size_t tasks, const StreamTraits &terminal) {
  std::string text = fmt::format("bounds: {} of {} tasks have one", check.bounded, tasks);
  text += check.absent.empty() ? "" : fmt::format(" ({})", check.absent);
  const bool is_broken =
      std::any_of(check.rows.begin(), check.rows.end(), [](const BoundCheck::Row &row) { return row.is_broken(); });
  if (!is_broken) {
    return text + fmt::format("{}, {}\n", check.bounded > 0 ? "; no response was above its bound" : "",
                              tinted("no execution above its wcet", Tint::Good, terminal.colour));
  }
  text += "\n";
  for (const BoundCheck::Row &row : check.rows) {
    if (row.exceeded > 0) {
      text += fmt::format("  {}: {} of its responses {} above the bound of {} ({}), the longest {}\n",
                          tinted(row.name, Tint::Bad, terminal.colour), format_count(row.exceeded),
                          row.exceeded == 1 ? "is" : "are", humanize_duration(row.bound), row.method,
                          humanize_duration(row.worst));
    }
    if (row.on_worker > 0) {
      text += fmt::format("  {}: held its worker for up to {}, its wcet is {}\n",
                          tinted(row.name, Tint::Caution, terminal.colour), humanize_duration(row.on_worker),
                          humanize_duration(row.wcet));
    }
  }
  return text + "bounds hold for executions within the wcet and no overheads: `redag analyze` takes overheads\n";
}

Json to_json(const BoundCheck &check) {
  Json tasks = Json::array();
  for (const BoundCheck::Row &row : check.rows) {
    tasks.push_back(Json{{"name", row.name},
                         {"bound_ns", row.bound > 0 ? Json(row.bound) : Json()},
                         {"method", row.bound > 0 ? Json(row.method) : Json()},
                         {"exceeded", row.exceeded},
                         {"worst_ns", row.exceeded > 0 ? Json(row.worst) : Json()},
                         {"wcet_ns", row.wcet},
                         {"on_worker_above_wcet_ns", row.on_worker > 0 ? Json(row.on_worker) : Json()}});
  }
  return Json{{"bounded", check.bounded}, {"absent", check.absent}, {"tasks", tasks}};
}

}  // namespace redag::cli
