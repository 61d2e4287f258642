// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/experiment/factorial_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using experiment::Factorial;
using experiment::FactorialEffects;
using experiment::FactorialResults;
using experiment::FactorialRow;
using experiment::FactorKind;
using experiment::kNoLevel;
using experiment::Median;
using experiment::Metric;

constexpr std::size_t kMostRowsShown = 60;  // combinations; more are only in the file

Median total(const Factorial &factorial, const FactorialResults &results, const FactorialRow &row, Metric metric) {
  return *over_runs(factorial, results, row, row.runs().front().dags.size() - 1, metric);
}

// Formats the median and its interval. If most runs missed nothing, adds the misses of all runs.
std::string with_interval(const Median &median, std::uint64_t missed, std::uint64_t released) {
  if (median.median == 0 && missed > 0) {
    return fmt::format("{} of {} in all runs", format_count(missed), format_count(released));
  }
  const std::string middle = format_percent(median.median);
  const std::string low = format_percent(median.low);
  const std::string high = format_percent(median.high);
  return low == high ? middle : fmt::format("{} ({}..{})", middle, low, high);
}

// Returns the share over all jobs of all runs. Unlike a median, it shows a miss of a single run.
double missed_share(const FactorialRow &row) {
  const std::size_t all = row.runs().front().dags.size() - 1;
  const auto released = static_cast<double>(sum_over_runs(row, all, experiment::Measure::Released));
  return static_cast<double>(sum_over_runs(row, all, experiment::Measure::Missed)) / std::max(1.0, released);
}

Duration rounded(double value) { return static_cast<Duration>(value); }

std::string combination_table(const Factorial &factorial, const FactorialResults &results, const StreamTraits &traits) {
  std::vector<Column> columns;
  std::vector<FactorKind> shown;
  for (const experiment::Factor &factor : factorial.factors()) {
    if (factor.levels.empty() || (factor.levels.size() == 1 && factor.kind != FactorKind::Executor)) continue;
    shown.push_back(factor.kind);
    columns.push_back({to_string(factor.kind), factor.numeric, 1000});
  }
  for (const char *title : {"missed", "skipped", "paper counts"}) columns.push_back({title, true, 900});
  columns.push_back({"max lateness", true, 200});
  Table table(std::move(columns));
  for (const FactorialRow &row : results.rows) {
    if (row.repetition.empty()) continue;
    std::vector<Cell> cells;
    for (const FactorKind kind : shown) {
      const std::uint32_t level = factorial.points()[row.point].of(kind);
      cells.push_back({level == kNoLevel ? "-" : factorial.factors()[static_cast<std::size_t>(kind)].levels[level]});
    }
    const auto value = [&](Metric metric) { return total(factorial, results, row, metric); };
    const std::size_t all = row.runs().front().dags.size() - 1;
    cells.push_back({with_interval(value(Metric::MissRatio), sum_over_runs(row, all, experiment::Measure::Missed),
                                   sum_over_runs(row, all, experiment::Measure::Released))});
    cells.push_back({format_percent(value(Metric::DropRatio).median)});
    cells.push_back({format_percent(value(Metric::PaperMissRatio).median)});
    const std::optional<Median> lateness = over_runs(factorial, results, row, all, Metric::MaxLateness);
    cells.push_back({lateness ? humanize_duration(rounded(lateness->median)) : "-"});
    table.add(std::move(cells));
  }
  return table.render(traits.width, traits.colour);
}

// Returns for each workload and executor the mean over all combinations, and the best and the worst one.
std::string range_table(const Factorial &factorial, const FactorialResults &results, const StreamTraits &traits) {
  Table table({{"workload", false, 100},
               {"executor", false, 1000},
               {"combinations", true, 100},
               {"mean missed", true, 900},
               {"least", true, 800},
               {.title = "at", .importance = 300, .prose = true},
               {"most", true, 800},
               {.title = "at", .importance = 300, .prose = true}});
  for (std::uint32_t w = 0; w < factorial.plan().workloads.size(); ++w) {
    for (std::uint32_t e = 0; e < factorial.plan().executors.size(); ++e) {
      std::vector<std::pair<double, const FactorialRow *>> rows;
      double sum = 0;
      for (const FactorialRow &row : results.rows) {
        const experiment::FactorialPoint &point = factorial.points()[row.point];
        if (point.of(FactorKind::Workload) != w || point.of(FactorKind::Executor) != e || row.repetition.empty())
          continue;
        rows.emplace_back(missed_share(row), &row);
        sum += rows.back().first;
      }
      if (rows.empty()) continue;
      const auto by_miss = [](const auto &a, const auto &b) { return a.first < b.first; };
      const auto least = std::min_element(rows.begin(), rows.end(), by_miss);
      const auto most = std::max_element(rows.begin(), rows.end(), by_miss);
      const auto place = [&](const FactorialRow &row) {
        std::string text;
        for (const experiment::Factor &factor : factorial.factors()) {
          const std::uint32_t level = factorial.points()[row.point].of(factor.kind);
          const bool said = factor.kind == FactorKind::Workload || factor.kind == FactorKind::Executor;
          if (said || level == kNoLevel || factor.levels.size() < 2) continue;
          text += fmt::format("{}{} {}", text.empty() ? "" : ", ", to_string(factor.kind), factor.levels[level]);
        }
        return text;
      };
      const bool same = least->first == most->first;
      table.add({{factorial.plan().workloads[w].name},
                 {factorial.plan().executors[e]},
                 {format_count(rows.size())},
                 {format_percent(sum / static_cast<double>(rows.size()))},
                 {format_percent(least->first)},
                 {same ? "everywhere" : place(*least->second)},
                 {format_percent(most->first)},
                 {same ? "everywhere" : place(*most->second)}});
    }
  }
  return table.render(traits.width, traits.colour);
}

std::string effects_table(const Factorial &factorial, const std::vector<FactorialEffects> &all,
                          const StreamTraits &traits) {
  Table table({{"workload", false, 100}, {"executor", false, 1000}, {"what", false, 900}, {"explains", true, 900}});
  bool any = false;
  for (const FactorialEffects &one : all) {
    if (one.effects.variance <= 0) continue;
    any = true;
    const auto add = [&](const std::string &what, double share) {
      table.add({{factorial.plan().workloads[one.workload].name},
                 {factorial.plan().executors[one.executor]},
                 {what},
                 {format_percent(share)}});
    };
    for (const experiment::Effects::Term &term : one.effects.terms) {
      std::string what;
      for (const std::size_t f : term.factors)
        what += (what.empty() ? "" : " x ") + std::string(to_string(one.factors[f]));
      add(what, term.share);
    }
    if (one.factors.size() > 2) add("three or more factors together", one.effects.higher);
    add("chance (between runs of one combination)", one.effects.noise);
  }
  return any ? table.render(traits.width, traits.colour) : std::string();
}

}  // namespace

std::string describe(const Factorial &factorial, const FactorialResults &results, const StreamTraits &traits) {
  std::string text;
  const auto heading = [&](const char *words) {
    text += (text.empty() ? "" : "\n") + tinted(words, Tint::Strong, traits.colour) + "\n";
  };
  if (results.done > 0) {
    if (results.rows.size() <= kMostRowsShown) {
      heading(
          "Missed deadlines: late, skipped or aborted jobs, of all releases (medians with confidence intervals)\n"
          "max lateness: of all runs");
      text += combination_table(factorial, results, traits);
    } else {
      heading("Missed deadlines: late, skipped or aborted jobs, of all releases");
      text += range_table(factorial, results, traits);
    }
  }
  const std::vector<FactorialEffects> effects = effects_of(factorial, results);
  if (const std::string table = effects_table(factorial, effects, traits); !table.empty()) {
    heading("Variation of the miss ratio that each factor explains");
    text += table;
  }
  text += fmt::format(
      "\n{} runs, {} checks of their traces: {}; {}\n", format_count(results.done), format_count(results.checks),
      results.violations == 0 ? std::string("no violation of the model")
                              : fmt::format("{} VIOLATIONS", format_count(results.violations)),
      results.unenforced == 0 ? std::string("every max_active bound was kept")
                              : fmt::format("max_active was EXCEEDED in {} runs", format_count(results.unenforced)));
  if (!results.complete()) {
    text += fmt::format(
        "\n"
        "{} of {} runs are done\n",
        format_count(results.done), format_count(results.units));
  }
  return text;
}

}  // namespace redag::cli
