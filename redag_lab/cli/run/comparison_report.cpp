// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/comparison_report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::cli {
namespace {

// Returns "13.9 % to 14.8 %" if repetitions differ, else an empty text.
std::string range_text(const lab::Spread &miss) {
  const std::string low = format_percent(miss.min);
  const std::string high = format_percent(miss.max);
  return low == high ? std::string() : fmt::format("{} to {}", low, high);
}

Json spread_json(const lab::Spread &spread) {
  return Json{{"median", spread.median}, {"min", spread.min}, {"max", spread.max}};
}

Json counts_json(const metrics::JobCounts &jobs) {
  return Json{{"released", jobs.released}, {"finished", jobs.finished}, {"late", jobs.late},
              {"skipped", jobs.skipped},   {"aborted", jobs.aborted},   {"missed", jobs.missed()}};
}

Json optional_spread(const std::optional<lab::Spread> &spread) { return spread ? spread_json(*spread) : Json(); }

Json row_json(const lab::ExecutorResults &results, const std::string &name, std::size_t dag, bool is_dag) {
  Json json{{"name", name}};
  json.update(counts_json(results.jobs(dag)));
  json["miss_ratio"] = spread_json(results.late(dag));
  json["miss_ratio_with_lost"] = spread_json(results.miss(dag));
  if (is_dag) {
    json["end_to_end_late"] = results.late_end_to_end(dag);
    json["end_to_end_p50_ns"] = optional_spread(results.end_to_end(dag, &metrics::Distribution::p50));
    json["end_to_end_p95_ns"] = optional_spread(results.end_to_end(dag, &metrics::Distribution::p95));
    json["end_to_end_p99_ns"] = optional_spread(results.end_to_end(dag, &metrics::Distribution::p99));
    const std::optional<Duration> longest = results.longest_end_to_end(dag);
    json["end_to_end_max_ns"] = longest ? Json(*longest) : Json();
  }
  return json;
}

std::string comparison_table(const lab::Comparison &comparison, const StreamTraits &terminal) {
  const bool is_repeated = comparison.executors.front().repetitions.size() > 1;
  std::vector<Column> columns = {
      {"DAG", false, 9}, {"executor", false, 9}, {"jobs", true, 7}, {"late", true, 2}, {"missed", true, 8}};
  if (is_repeated) columns.push_back({"missed, by repetition", true, 3});
  columns.insert(columns.end(), {{"p50", true, 4}, {"p95", true, 1}, {"p99", true, 6}, {"max", true, 5}});
  Table table(std::move(columns));
  for (std::size_t dag = 0; dag < comparison.dags.size(); ++dag) {
    for (const lab::ExecutorResults &results : comparison.executors) {
      const metrics::JobCounts jobs = results.jobs(dag);
      const auto time = [&](Duration metrics::Distribution::*percentile) {
        const std::optional<lab::Spread> spread = results.end_to_end(dag, percentile);
        return Cell{spread ? humanize_duration(static_cast<Duration>(spread->median)) : "-"};
      };
      const std::optional<Duration> longest = results.longest_end_to_end(dag);
      std::vector<Cell> row = {
          {&results == &comparison.executors.front() ? comparison.dags[dag] : ""},
          {results.variant.name},
          {format_count(jobs.released)},
          {format_count(jobs.late)},
          {format_count_and_share(jobs.missed(), jobs.released), jobs.missed() > 0 ? Tint::Bad : Tint::Good}};
      if (is_repeated) row.push_back({range_text(results.miss(dag))});
      row.insert(row.end(), {time(&metrics::Distribution::p50),
                             time(&metrics::Distribution::p95),
                             time(&metrics::Distribution::p99),
                             {longest ? humanize_duration(*longest) : "-",
                              results.late_end_to_end(dag) > 0 ? Tint::Bad : Tint::Plain}});
      table.add(std::move(row));
    }
  }
  return table.render(terminal.width, terminal.colour);
}

// Explains the columns of the table in words.
std::string legend(const lab::Comparison &comparison, std::size_t repetitions) {
  std::string text = "missed: jobs that were late, skipped or aborted, of all jobs";
  if (repetitions > 1) text += " of all repetitions";
  text +=
      "\n"
      "p50 to max: end to end, from the release of a source to the finish of a sink";
  const bool several = std::any_of(comparison.executors.front().repetitions.front().begin(),
                                   comparison.executors.front().repetitions.front().end(),
                                   [](const metrics::DagSummary &seen) { return seen.end_to_end.sinks.size() > 1; });
  if (several) text += "; with several sinks, each figure is that of the worst one";
  if (repetitions > 1) text += "; max is the largest of all repetitions; p50 to p99 are medians over repetitions";
  return text + "\n\n";
}

}  // namespace

std::vector<std::string> verdicts(const lab::Comparison &comparison) {
  std::vector<std::string> lines;
  for (std::size_t dag = 0; dag + 1 < comparison.dags.size(); ++dag) {
    std::vector<report::Contender> contenders;
    for (const lab::ExecutorResults &results : comparison.executors) {
      const metrics::JobCounts jobs = results.jobs(dag);
      contenders.push_back({.name = results.variant.name,
                            .missed = jobs.missed(),
                            .released = jobs.released,
                            .misses = results.miss(dag)});
    }
    lines.push_back(report::comparison_line(comparison.dags[dag], contenders));
  }
  return lines;
}

std::string caveat(const lab::Comparison &comparison) {
  std::vector<std::string> with;
  std::vector<std::string> without;
  for (const lab::ExecutorResults &results : comparison.executors) {
    (results.realtime ? with : without).push_back(results.variant.name);
  }
  if (with.empty() || without.empty()) return {};
  return fmt::format(
      "{} had real-time (SCHED_FIFO) threads, {} had not: on a busy machine, this alone explains part of the "
      "difference; mte-fifo and ste-fifo, or --realtime, give real-time threads to all executors",
      join(with), join(without));
}

std::string describe(const lab::Comparison &comparison, const StreamTraits &terminal) {
  const std::size_t repetitions = comparison.executors.front().repetitions.size();
  const bool simulated = comparison.driver == trace::Driver::Simulator;
  std::string text;
  for (const std::string &line : verdicts(comparison)) text += line + "\n";
  text += fmt::format("\n{}: {}, {} of {} {}, seed {}\n", comparison.workload, plural(comparison.workers, "worker"),
                      plural(repetitions, "repetition"), humanize_duration(comparison.duration),
                      simulated ? "in virtual time" : "on threads", comparison.seed);
  for (const lab::ExecutorResults &results : comparison.executors) {
    text += fmt::format("  {}: preemption {}{}\n", results.variant.name, results.preemption,
                        results.preemption_why.empty() ? "" : " (" + results.preemption_why + ")");
  }
  text += "\n" + comparison_table(comparison, terminal);
  text += legend(comparison, repetitions);
  if (const std::string unfair = caveat(comparison); !unfair.empty()) text += "note: " + unfair + "\n";
  std::string violated;
  for (const lab::ExecutorResults &results : comparison.executors) {
    if (results.check_violations == 0) continue;
    violated += fmt::format("{}{}: {} violations", violated.empty() ? "" : ", ", results.variant.name,
                            format_count(results.check_violations));
  }
  text += "trace check: " +
          (violated.empty() ? tinted("ok", Tint::Good, terminal.colour) + ", every run"
                            : tinted(violated, Tint::Bad, terminal.colour)) +
          "\n";
  return text;
}

Json to_json(const lab::Comparison &comparison) {
  Json executors = Json::array();
  for (const lab::ExecutorResults &results : comparison.executors) {
    Json dags = Json::array();
    for (std::size_t dag = 0; dag + 1 < comparison.dags.size(); ++dag) {
      dags.push_back(row_json(results, comparison.dags[dag], dag, true));
    }
    const std::size_t total = comparison.dags.size() - 1;
    executors.push_back(Json{{"name", results.variant.name},
                             {"executor", results.variant.executor},
                             {"preemption", results.preemption},
                             {"preemption_why", results.preemption_why},
                             {"realtime_threads", results.realtime},
                             {"repetitions", results.repetitions.size()},
                             {"check_violations", results.check_violations},
                             {"warnings", results.warnings},
                             {"dags", dags},
                             {"total", row_json(results, "total", total, false)}});
  }
  return Json{{"format", "redag.comparison/3"},
              {"workload", comparison.workload},
              {"driver", trace::to_string(comparison.driver)},
              {"workers", comparison.workers},
              {"duration_ns", comparison.duration},
              {"seed", comparison.seed},
              {"executors", executors},
              {"verdicts", verdicts(comparison)},
              {"caveat", caveat(comparison)},
              {"warnings", comparison.warnings}};
}

}  // namespace redag::cli
