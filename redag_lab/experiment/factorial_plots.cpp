// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws the plots of factorial_results.hpp.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "redag_lab/experiment/factorial_results.hpp"
#include "redag_lab/experiment/line_plot.hpp"

namespace redag::experiment {
namespace {

constexpr std::size_t kMostPanels = 12;

// Returns the next round number; an axis should not end at 0.0273.
double round_up(double value) {
  if (!(value > 0)) return 0.01;
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1.0, 2.0, 3.0, 5.0, 10.0}) {
    if (value <= step * decade * 1.000001) return step * decade;
  }
  return 10 * decade;
}

// Returns the mean of the medians of all points with one level.
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
  // Thins out the labels to the number that fits.
  constexpr std::size_t kRoom = 42;  // characters
  std::size_t characters = 0;
  for (const std::string &level : factor.levels) characters = std::max(characters, level.size() + 1);
  const std::size_t every = std::max<std::size_t>(1, (factor.levels.size() * characters + kRoom - 1) / kRoom);
  // The axis starts at 0 only if some values come near 0.
  const bool numeric = factor.numeric && std::stod(factor.levels.front()) <= std::stod(factor.levels.back()) / 2;
  for (std::size_t level = 0; level < factor.levels.size(); ++level) {
    const double x = numeric ? std::stod(factor.levels[level]) : static_cast<double>(level) + 0.5;
    if (level % every == 0) panel.ticks.emplace_back(x, factor.levels[level]);
    for (std::size_t e = 0; e < executors.size(); ++e) {
      std::vector<Median> medians;
      for (const FactorialRow &row : results.rows) {
        const FactorialPoint &point = factorial.points()[row.point];
        const std::uint32_t here = point.of(factor.kind);
        // A factor without effect on the executor gives a flat line.
        if (point.of(FactorKind::Executor) != e || (here != level && here != kNoLevel) || row.repetition.empty())
          continue;
        medians.push_back(*over_runs(factorial, results, row, row.runs().front().dags.size() - 1, Metric::MissRatio));
      }
      if (medians.empty()) continue;
      LinePlot::Value value = mean_at(medians);
      value.x = x;
      panel.series[e].push_back(value);
    }
  }
  if (!numeric) panel.ticks.emplace_back(static_cast<double>(factor.levels.size()), "");
  if (numeric && (factor.levels.size() - 1) % every != 0) panel.ticks.emplace_back(std::stod(factor.levels.back()), "");
  return panel;
}

// Returns the panel of that title, and appends a new one if there is none. Returns null if there are too many panels.
LinePlot::Panel *panel_named(LinePlot &plot, const std::string &title) {
  const auto known = std::find_if(plot.panels.begin(), plot.panels.end(),
                                  [&](const LinePlot::Panel &panel) { return panel.title == title; });
  if (known != plot.panels.end()) return &*known;
  if (plot.panels.size() == kMostPanels) return nullptr;
  plot.panels.push_back(LinePlot::Panel{title, {}, {}, {}});
  plot.panels.back().series.resize(plot.lines.size());
  return &plot.panels.back();
}

// Returns the share of the due answers that arrived by each time, as medians of the runs. Dropped answers never arrive.
std::vector<LinePlot::Value> answered(const FactorialRow &row, std::size_t dag) {
  std::vector<LinePlot::Value> curve;
  for (std::size_t q = 0; q < kQuantiles.size(); ++q) {
    std::vector<double> times;
    std::vector<double> shares;
    for (const Observation &run : row.runs()) {
      const DagObservation &seen = run.dags[dag];
      if (seen.quantiles.empty()) continue;
      times.push_back(static_cast<double>(seen.quantiles[q]) / kMillisecond);
      shares.push_back(kQuantiles[q] / 100 * static_cast<double>(seen.of(Measure::Answered)) /
                       static_cast<double>(seen.of(Measure::AnswersDue)));
    }
    if (times.empty()) continue;
    const double share = experiment::median_of(std::move(shares)).median;
    curve.push_back({experiment::median_of(std::move(times)).median, share, share, share});
  }
  return curve;
}

}  // namespace

std::string to_svg(const Factorial &factorial, const FactorialResults &results) {
  const FactorialPlan &plan = factorial.plan();
  LinePlot plot;
  plot.title = fmt::format("{}: missed deadlines", plan.name);
  plot.subtitle = fmt::format("{}; {} run{} of {} per combination; each value is a mean over all other factors",
                              to_string(plan.world), plan.repetitions, plan.repetitions == 1 ? "" : "s",
                              format_duration(plan.duration));
  if (!results.complete()) plot.subtitle = fmt::format("{} of {} runs are done", results.done, results.units);
  plot.y_label = "late, skipped or aborted, of all releases";
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
  plot.y_end = std::min(1.0, round_up(largest));
  return experiment::to_svg(plot);
}

std::optional<std::string> distance_svg(const Factorial &factorial, const FactorialResults &results) {
  const Factor &load = factorial.factors()[static_cast<std::size_t>(FactorKind::Utilization)];
  if (load.levels.size() < 2) return std::nullopt;
  const FactorialPlan &plan = factorial.plan();
  LinePlot plot;
  plot.title = fmt::format("{}: distance to the ideal", plan.name);
  plot.subtitle = fmt::format(
      "medians of {} runs of {}, each compared with the ideal on the same jobs; fewer misses than the ideal are drawn "
      "as 0",
      plan.repetitions, format_duration(plan.duration));
  if (!results.complete()) plot.subtitle = fmt::format("{} of {} runs are done", results.done, results.units);
  plot.x_label = "utilization per worker";
  plot.y_label = "misses above the ideal, of all releases";
  // The ideal and the unlimited executor are references and have no line.
  std::copy_if(plan.executors.begin(), plan.executors.end(), std::back_inserter(plot.lines),
               [](const std::string &executor) { return executor != kIdeal && executor != kUnlimited; });
  double largest = 0;
  for (const FactorialRow &row : results.rows) {
    if (row.repetition.empty()) continue;
    const std::size_t total = row.runs().front().dags.size() - 1;
    const std::optional<Median> distance = over_runs(factorial, results, row, total, Metric::ExcessMissRatio);
    if (!distance) continue;
    const FactorialPoint &point = factorial.points()[row.point];
    const auto line = std::find(plot.lines.begin(), plot.lines.end(), plan.executors[point.of(FactorKind::Executor)]);
    if (line == plot.lines.end()) continue;
    FactorialPoint place = point;
    place.level[static_cast<std::size_t>(FactorKind::Utilization)] = kNoLevel;
    place.level.back() = kNoLevel;
    LinePlot::Panel *panel = panel_named(plot, describe(plan, place).substr(9));
    if (panel == nullptr) continue;
    LinePlot::Value value{std::stod(load.levels[point.of(FactorKind::Utilization)]), std::max(0.0, distance->median),
                          std::max(0.0, distance->low), std::max(0.0, distance->high)};
    largest = std::max(largest, value.high);
    panel->series[static_cast<std::size_t>(line - plot.lines.begin())].push_back(value);
  }
  if (plot.panels.empty()) return std::nullopt;
  for (LinePlot::Panel &panel : plot.panels) {
    for (const std::string &level : load.levels) panel.ticks.emplace_back(std::stod(level), level);
  }
  plot.y_end = std::min(1.0, round_up(largest));
  return experiment::to_svg(plot);
}

std::string responses_svg(const Factorial &factorial, const FactorialResults &results) {
  const FactorialPlan &plan = factorial.plan();
  LinePlot plot;
  plot.title = fmt::format("{}: response times", plan.name);
  plot.subtitle = "medians of the runs; the slowest percent is not shown; lost jobs never finish";
  plot.x_label = "end-to-end response in ms";
  plot.y_label = "share of due jobs that finished";
  plot.lines = plan.executors;
  for (const FactorialRow &row : results.rows) {
    const FactorialPoint &point = factorial.points()[row.point];
    if (row.repetition.empty()) continue;
    // Each DAG has a panel for each combination of the factors other than the executor.
    FactorialPoint place = point;
    place.level.back() = kNoLevel;
    for (std::size_t dag = 0; dag + 1 < row.runs().front().dags.size(); ++dag) {
      const std::string title =
          fmt::format("{}: {}", describe(plan, place).substr(9), row.runs().front().dags[dag].dag);
      if (LinePlot::Panel *panel = panel_named(plot, title); panel != nullptr) {
        panel->series[point.of(FactorKind::Executor)] = answered(row, dag);
      }
    }
  }
  for (LinePlot::Panel &panel : plot.panels) {
    double end = 0;
    for (auto &series : panel.series) {
      if (series.size() == kQuantiles.size()) series.pop_back();  // the maximum would take up most of the axis
      for (const LinePlot::Value &value : series) end = std::max(end, value.x);
    }
    end = round_up(end);
    for (int tick = 0; tick <= 4; ++tick)
      panel.ticks.emplace_back(end * tick / 4, fmt::format("{:.3g}", end * tick / 4));
  }
  return experiment::to_svg(plot);
}

}  // namespace redag::experiment
