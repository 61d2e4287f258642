// The JSON document and the plot of factorial_results.hpp, and the files.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/experiment/factorial_results.hpp"
#include "redag/experiment/folder.hpp"
#include "redag/experiment/line_plot.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/version.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;

Json levels_json(const Factorial &factorial, const FactorialPoint &point) {
  Json levels = Json::object();
  for (const Factor &factor : factorial.factors()) {
    if (const std::uint32_t level = point.of(factor.kind); level != kNoLevel) {
      levels[to_string(factor.kind)] = factor.levels[level];
    }
  }
  return levels;
}

Json row_json(const Factorial &factorial, const FactorialResults &results, const FactorialRow &row) {
  Json json = {{"factors", levels_json(factorial, factorial.points()[row.point])}, {"repetitions", row.runs.size()}};
  if (row.runs.empty()) return json;
  std::set<std::string> worlds;
  std::set<std::string> modes;
  std::uint64_t violations = 0;
  bool enforced = true;
  for (const Observation &run : row.runs) {
    worlds.insert(run.world);
    modes.insert(run.preemption);
    violations += run.violations;
    enforced = enforced && run.enforced;
  }
  json["world"] = worlds;
  json["preemption"] = modes;
  json["violations"] = violations;
  json["all_enforced"] = enforced;
  json["dags"] = Json::array();
  for (std::size_t dag = 0; dag < row.runs.front().dags.size(); ++dag) {
    Json metrics = {{"dag", row.runs.front().dags[dag].dag}};
    for (std::size_t m = 0; m < kMetricCount; ++m) {
      const auto metric = static_cast<Metric>(m);
      const std::optional<Median> median = median_of(factorial, results, row, dag, metric);
      if (!median) continue;
      metrics["confidence"] = median->confidence;
      metrics[std::string(to_string(metric)) + (is_duration(metric) ? "_ns" : "")] = {median->median, median->low,
                                                                                      median->high};
    }
    json["dags"].push_back(std::move(metrics));
  }
  return json;
}

Json effects_json(const Factorial &factorial, const FactorialEffects &one) {
  Json json = {{"workload", factorial.plan().workloads[one.workload].name},
               {"executor", factorial.plan().executors[one.executor]},
               {"mean_miss_ratio", one.effects.mean},
               {"variance", one.effects.variance},
               {"shares", Json::array()},
               {"higher_interactions", one.effects.higher},
               {"noise", one.effects.noise},
               {"levels", Json::array()}};
  for (const Effects::Term &term : one.effects.terms) {
    Json names = Json::array();
    for (const std::size_t f : term.factors) names.push_back(to_string(one.factors[f]));
    json["shares"].push_back(Json{{"factors", std::move(names)}, {"share", term.share}});
  }
  for (std::size_t f = 0; f < one.factors.size(); ++f) {
    json["levels"].push_back(Json{{"factor", to_string(one.factors[f])}, {"miss_ratio", one.effects.levels[f]}});
  }
  return json;
}

// The next round number: an axis should not end at 0.0273.
double round_up(double value) {
  if (!(value > 0)) return 0.01;
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 3.0, 5.0, 10.0}) {
    if (value <= step * decade * 1.000001) return std::min(1.0, step * decade);
  }
  return 1;
}

// Mean of the medians at a level over all points that have it.
LinePlot::Value mean_at(const std::vector<Median> &medians) {
  LinePlot::Value value;
  const auto n = static_cast<double>(medians.size());
  for (const Median &median : medians) {
    value.y += median.median / n;
    value.low += median.low / n;
    value.high += median.high / n;
  }
  return value;
}

LinePlot::Panel panel_of(const Factorial &factorial, const FactorialResults &results, const Factor &factor) {
  const std::vector<std::string> &executors = factorial.plan().executors;
  LinePlot::Panel panel;
  panel.x_label = to_string(factor.kind);
  std::replace(panel.x_label.begin(), panel.x_label.end(), '_', ' ');
  if (factor.kind == FactorKind::Utilization) panel.x_label += " per worker";
  panel.series.resize(executors.size());
  // An axis from 0 is of use only for values that come near it.
  const bool numeric = factor.numeric && std::stod(factor.levels.front()) <= std::stod(factor.levels.back()) / 2;
  for (std::size_t level = 0; level < factor.levels.size(); ++level) {
    const double x = numeric ? std::stod(factor.levels[level]) : static_cast<double>(level) + 0.5;
    // As many labels as there is room for.
    const std::size_t every = (factor.levels.size() + 9) / 10;
    const bool last = level + 1 == factor.levels.size();
    if (level % every == 0 || last) panel.ticks.emplace_back(x, factor.levels[level]);
    for (std::size_t e = 0; e < executors.size(); ++e) {
      std::vector<Median> medians;
      for (const FactorialRow &row : results.rows) {
        const FactorialPoint &point = factorial.points()[row.point];
        const std::uint32_t here = point.of(factor.kind);
        // Where the factor means nothing to the executor its line is flat.
        if (point.of(FactorKind::Executor) != e || (here != level && here != kNoLevel) || row.runs.empty()) continue;
        medians.push_back(*median_of(factorial, results, row, row.runs.front().dags.size() - 1, Metric::MissRatio));
      }
      if (medians.empty()) continue;
      LinePlot::Value value = mean_at(medians);
      value.x = x;
      panel.series[e].push_back(value);
    }
  }
  if (!numeric) panel.ticks.emplace_back(static_cast<double>(factor.levels.size()), "");
  return panel;
}

}  // namespace

std::string to_json(const Factorial &factorial, const FactorialResults &results, const std::vector<std::string> &runs) {
  const FactorialPlan &plan = factorial.plan();
  Json document = {{"format", "redag.experiment.factorial/1"},
                   {"name", plan.name},
                   {"version", kVersion},
                   {"plan", to_yaml(plan)},
                   {"world", to_string(plan.world)},
                   {"duration_ns", plan.duration},
                   {"repetitions", plan.repetitions},
                   {"units", results.units},
                   {"done", results.done},
                   {"complete", results.complete()},
                   {"checks", results.checks},
                   {"violations", results.violations},
                   {"runs_beyond_max_active", results.unenforced},
                   {"factors", Json::array()},
                   {"points", Json::array()},
                   {"effects", Json::array()},
                   {"runs", Json::array()}};
  for (const Factor &factor : factorial.factors()) {
    if (factor.levels.empty()) continue;
    document["factors"].push_back(
        Json{{"name", to_string(factor.kind)}, {"numeric", factor.numeric}, {"levels", factor.levels}});
  }
  for (const FactorialRow &row : results.rows) document["points"].push_back(row_json(factorial, results, row));
  for (const FactorialEffects &one : effects_of(factorial, results)) {
    document["effects"].push_back(effects_json(factorial, one));
  }
  for (const std::string &run : runs) document["runs"].push_back(Json::parse(run));
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string to_svg(const Factorial &factorial, const FactorialResults &results) {
  const FactorialPlan &plan = factorial.plan();
  LinePlot plot;
  plot.title = fmt::format("{}: deadlines missed", plan.name);
  plot.subtitle = fmt::format("{}; {} run{} of {} a combination; each value is a mean over all other factors",
                              to_string(plan.world), plan.repetitions, plan.repetitions == 1 ? "" : "s",
                              format_duration(plan.duration));
  if (!results.complete()) plot.subtitle = fmt::format("{} of {} runs done", results.done, results.units);
  plot.y_label = "late or dropped, of all releases";
  plot.lines = plan.executors;
  for (const Factor &factor : factorial.factors()) {
    if (factor.kind == FactorKind::Executor || factor.levels.size() < 2) continue;
    plot.panels.push_back(panel_of(factorial, results, factor));
  }
  if (plot.panels.empty()) {
    plot.panels.push_back(
        panel_of(factorial, results, factorial.factors()[static_cast<std::size_t>(FactorKind::Workload)]));
  }
  double largest = 0;
  for (const LinePlot::Panel &panel : plot.panels) {
    for (const auto &series : panel.series) {
      for (const LinePlot::Value &value : series) largest = std::max({largest, value.y, value.high});
    }
  }
  plot.y_end = round_up(largest);
  return experiment::to_svg(plot);
}

Result<void> write_results(const std::string &folder, const Factorial &factorial, const FactorialResults &results) {
  std::vector<std::pair<std::string, std::string>> files = {
      {"factorial.csv", to_csv(factorial, results)},
      {"observations.csv", observations_csv(factorial, results)},
      {"factorial.json", to_json(factorial, results, read_runs({folder}))},
      {"factorial.svg", to_svg(factorial, results)}};
  if (factorial.plan().quantiles) files.emplace_back("response_quantiles.csv", quantiles_csv(factorial, results));
  for (const auto &[name, text] : files) {
    Result<trace::OutputFile> file = trace::OutputFile::create(folder + "/" + name);
    if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
    file->write(text);
    if (Result<void> done = file->commit(); !done) return done;
  }
  return {};
}

}  // namespace redag::experiment
