// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance_results.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/base/provenance.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/version.hpp"
#include "redag_lab/experiment/folder.hpp"
#include "redag_lab/experiment/line_plot.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostReplays = 20;

double per_worker(const AcceptancePoint &point) { return point.utilization / static_cast<double>(kMillion); }

Proportion ratio_of(const AcceptanceRow &row, const AcceptanceCell &cell) {
  return proportion(cell.accepted, row.sets);
}

bool same_panel(const AcceptancePoint &a, const AcceptancePoint &b) {
  return std::tie(a.dags, a.workers, a.deadlines, a.preemption) ==
         std::tie(b.dags, b.workers, b.deadlines, b.preemption);
}

Json row_json(const Acceptance &acceptance, const AcceptanceRow &row) {
  Json methods = Json::array();
  for (std::size_t m = 0; m < row.cells.size(); ++m) {
    const AcceptanceCell &cell = row.cells[m];
    const Proportion p = ratio_of(row, cell);
    methods.push_back(Json{{"method", acceptance.plan().methods[m]},
                           {"accepted", cell.accepted},
                           {"ratio", row.sets > 0 ? Json(p.ratio) : Json()},
                           {"ratio_low", p.low},
                           {"ratio_high", p.high},
                           {"unsound", cell.unsound},
                           {"not_applicable", cell.not_applicable}});
  }
  return Json{{"dags", row.point.dags},
              {"workers", row.point.workers},
              {"deadlines", to_string(row.point.deadlines)},
              {"preemption", to_string(row.point.preemption)},
              {"utilization", per_worker(row.point)},
              {"sets", row.sets},
              {"methods", std::move(methods)}};
}

// Returns the values that distinguish the panels.
std::string panel_title(const AcceptancePlan &plan, const AcceptancePoint &point) {
  const bool tasks = plan.workload.max_tasks == 1;
  std::string title = fmt::format("{} {}, {} worker{}", point.dags, tasks ? "tasks" : "DAGs", point.workers,
                                  point.workers == 1 ? "" : "s");
  title += point.preemption == PreemptionMode::Os ? ", full preemption" : ", no preemption";
  if (plan.deadlines.size() > 1 || point.deadlines != DeadlineKind::Implicit) {
    title += fmt::format(", {} deadlines", to_string(point.deadlines));
  }
  return title;
}

}  // namespace

AcceptanceCounter::AcceptanceCounter(const Acceptance &acceptance) : acceptance_(acceptance) {
  for (const AcceptancePoint &point : acceptance.points()) {
    results_.rows.push_back(AcceptanceRow{point, 0, std::vector<AcceptanceCell>(acceptance.plan().methods.size())});
  }
  results_.units = unit_count(acceptance.plan());
}

Result<void> AcceptanceCounter::add(std::uint64_t unit, const std::string &result) {
  if (unit >= results_.units || !acceptance_.is_result(result)) {
    return make_error(fmt::format("the plan has no unit {} with result '{}'", unit, result), kDamagedUnit);
  }
  AcceptanceRow &row = results_.rows[unit % results_.rows.size()];
  ++row.sets;
  ++results_.done;
  for (std::size_t m = 0; m < result.size(); ++m) {
    AcceptanceCell &cell = row.cells[m];
    if (result[m] == kAccepted || result[m] == kAcceptedUnsound) ++cell.accepted;
    if (result[m] == kAcceptedUnsound) ++cell.unsound;
    if (result[m] == kNotApplicable) ++cell.not_applicable;
  }
  if (std::vector<std::string> broken = acceptance_.broken_by(result); !broken.empty()) {
    // In order of unit, whatever the order in which they arrive.
    const auto at = std::lower_bound(results_.violations.begin(), results_.violations.end(), unit,
                                     [](const Violation &there, std::uint64_t number) { return there.unit < number; });
    results_.violations.insert(at, Violation{unit, result, std::move(broken)});
  }
  return {};
}

std::string to_csv(const Acceptance &acceptance, const AcceptanceResults &results) {
  std::string text =
      "dags,workers,deadlines,preemption,utilization,method,sets,accepted,ratio,ratio_low,ratio_high,unsound,"
      "not_applicable\n";
  for (const AcceptanceRow &row : results.rows) {
    for (std::size_t m = 0; m < row.cells.size(); ++m) {
      const AcceptanceCell &cell = row.cells[m];
      const Proportion p = ratio_of(row, cell);
      const std::string ratio = row.sets > 0 ? fmt::format("{:.6f}", p.ratio) : "";
      text += fmt::format("{},{},{},{},{},{},{},{},{},{:.6f},{:.6f},{},{}\n", row.point.dags, row.point.workers,
                          to_string(row.point.deadlines), to_string(row.point.preemption), per_worker(row.point),
                          acceptance.plan().methods[m], row.sets, cell.accepted, ratio, p.low, p.high, cell.unsound,
                          cell.not_applicable);
    }
  }
  return text;
}

std::string to_json(const Acceptance &acceptance, const AcceptanceResults &results,
                    const std::vector<std::string> &runs) {
  Json violations = Json::array();
  for (const Violation &violation : results.violations) {
    violations.push_back(Json{{"unit", violation.unit},
                              {"point", describe(acceptance.point_of(violation.unit))},
                              {"methods", violation.methods}});
  }
  Json document = {{"format", "redag.experiment.acceptance/1"},
                   {"provenance", Json::parse(provenance_to_json(current_provenance()))},
                   {"name", acceptance.plan().name},
                   {"version", kVersion},
                   {"plan", to_yaml(acceptance.plan())},
                   {"units", results.units},
                   {"done", results.done},
                   {"complete", results.complete()},
                   {"violations", std::move(violations)},
                   {"points", Json::array()},
                   {"runs", Json::array()}};
  for (const AcceptanceRow &row : results.rows) document["points"].push_back(row_json(acceptance, row));
  for (const std::string &run : runs) document["runs"].push_back(Json::parse(run));
  return document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string to_svg(const Acceptance &acceptance, const AcceptanceResults &results) {
  const AcceptancePlan &plan = acceptance.plan();
  LinePlot plot;
  plot.title = fmt::format("{}: schedulable workloads", plan.name);
  plot.subtitle = fmt::format("{} random workloads per point; bands: 95 % confidence", plan.sets);
  if (!results.complete()) plot.subtitle = fmt::format("{} of {} workloads done", results.done, results.units);
  plot.x_label = "utilization per worker";
  plot.y_label = "share of workloads accepted";
  for (const std::string &method : plan.methods) plot.lines.push_back(method);
  for (std::size_t r = 0; r < results.rows.size(); ++r) {
    const AcceptanceRow &row = results.rows[r];
    if (r == 0 || !same_panel(results.rows[r - 1].point, row.point)) {
      plot.panels.push_back(LinePlot::Panel{panel_title(plan, row.point), {}, {}, {}});
      plot.panels.back().series.resize(plan.methods.size());
    }
    for (std::size_t m = 0; m < row.cells.size(); ++m) {
      // A method that applies to no workload of a point has no value there.
      if (row.sets == 0 || row.cells[m].not_applicable == row.sets) continue;
      const Proportion p = ratio_of(row, row.cells[m]);
      plot.panels.back().series[m].push_back(LinePlot::Value{per_worker(row.point), p.ratio, p.low, p.high});
    }
  }
  return to_svg(plot);
}

Result<void> write_results(const std::string &folder, const Acceptance &acceptance, const AcceptanceResults &results) {
  const auto write = [&folder](const std::string &name, std::string_view text) -> Result<void> {
    Result<trace::OutputFile> file = trace::OutputFile::create(folder + "/" + name);
    if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
    file->write(text);
    return file->commit();
  };
  if (auto done = write("acceptance.csv", to_csv(acceptance, results)); !done) return done;
  if (auto done = write("acceptance.json", to_json(acceptance, results, read_runs({folder}))); !done) return done;
  if (auto done = write("acceptance.svg", to_svg(acceptance, results)); !done) return done;
  for (std::size_t v = 0; v < std::min(results.violations.size(), kMostReplays); ++v) {
    const Violation &violation = results.violations[v];
    const Result<std::string> replay = acceptance.replay(violation.unit, violation.result);
    if (!replay) return tl::unexpected<Diagnostics>(replay.error());
    if (auto done = write(fmt::format("violation-{}.yaml", violation.unit), *replay); !done) return done;
  }
  return {};
}

}  // namespace redag::experiment
