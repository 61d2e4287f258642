// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/difference_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "redag/base/text.hpp"
#include "redag/trace/worker_count.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using lab::DifferenceRow;
using lab::DifferenceSide;
using lab::FigureDifference;
using lab::Verdict;

struct Figure {
  const char *name;
  FigureDifference lab::RowDifference::*value;
  Verdict DifferenceRow::*verdict;
};
constexpr std::array<Figure, 4> kFigures = {{{"missed", &lab::RowDifference::miss_ratio, &DifferenceRow::miss},
                                             {"p50", &lab::RowDifference::p50, &DifferenceRow::p50},
                                             {"p95", &lab::RowDifference::p95, &DifferenceRow::p95},
                                             {"p99", &lab::RowDifference::p99, &DifferenceRow::p99}}};

bool is_miss(const Figure &figure) { return figure.value == &lab::RowDifference::miss_ratio; }

// Returns the text of one side's figure: a response time, or misses with their count.
std::string value_text(const Figure &figure, const DifferenceSide::Row &side, double value) {
  if (is_miss(figure)) return format_count_and_share(side.jobs.missed(), side.jobs.released);
  return side.has_responses() ? humanize_duration(static_cast<Duration>(value)) : "-";
}

std::string row_name(const DifferenceRow &row) {
  if (row.a->dag.empty()) return "all jobs";
  return row.a->task.empty() ? row.a->dag : row.a->dag + "." + row.a->task;
}

Tint tint_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::Better: return Tint::Good;
    case Verdict::Worse: return Tint::Bad;
    case Verdict::Same: return Tint::Plain;
    case Verdict::NotTested: return Tint::Faint;
  }
  return Tint::Plain;
}

std::string arrow(const std::string &a, const std::string &b) { return a == b ? a : a + " -> " + b; }

Cell figure_cell(const DifferenceRow &row, const Figure &figure) {
  const FigureDifference &value = row.figures.*figure.value;
  const Verdict verdict = row.*figure.verdict;
  const bool differs = verdict == Verdict::Better || verdict == Verdict::Worse;
  return Cell{arrow(value_text(figure, *row.a, value.a), value_text(figure, *row.b, value.b)) + (differs ? " *" : ""),
              tint_of(verdict)};
}

std::string signed_time(double value) {
  return (value < 0 ? "-" : "+") + humanize_duration(static_cast<Duration>(std::abs(value)));
}

std::string change_text(const Figure &figure, const FigureDifference &value) {
  if (is_miss(figure)) return fmt::format("{:+.2f} to {:+.2f} percentage points", 100 * value.low, 100 * value.high);
  return fmt::format("{} to {}", signed_time(value.low), signed_time(value.high));
}

std::string run_words(const DiffSide &side) {
  const std::vector<trace::RunInfo> &runs = side.jobs.runs();
  const trace::RunInfo &first = runs.front();
  return fmt::format("{}: {}, {}, {} worker{}, {}, {} run{} of {}", side.name, first.executor, first.preemption,
                     trace::worker_count(first), trace::worker_count(first) == 1 ? "" : "s",
                     trace::to_string(first.driver), runs.size(), runs.size() == 1 ? "" : "s",
                     humanize_duration(first.end - first.start));
}

std::string longest_text(const DifferenceSide::Row &side) {
  return side.has_responses() ? humanize_duration(side.max) : "-";
}

bool differs(const DifferenceRow &row) { return row.is_any(Verdict::Better) || row.is_any(Verdict::Worse); }

// All jobs together, what differs, and the DAGs of tasks that differ.
bool is_shown(const DifferenceRow &row, const std::vector<DifferenceRow> &rows) {
  if (row.a->dag.empty() || differs(row)) return true;
  return row.a->task.empty() && std::any_of(rows.begin(), rows.end(), [&](const DifferenceRow &other) {
           return other.a->dag == row.a->dag && differs(other);
         });
}

std::size_t count_of(const Diffed &diffed, Verdict wanted) {
  std::size_t count = 0;
  for (const DifferenceRow &row : diffed.difference.rows) {
    for (const Figure &figure : kFigures) count += row.*figure.verdict == wanted ? 1 : 0;
  }
  return count;
}

// Returns one sentence: who misses fewer deadlines, and how many figures differ.
std::string conclusion(const Diffed &diffed) {
  const std::size_t better = count_of(diffed, Verdict::Better);
  const std::size_t worse = count_of(diffed, Verdict::Worse);
  const DifferenceRow &all = diffed.difference.rows.front();
  const auto missed = [](const DifferenceSide::Row &side) {
    return format_count_and_share(side.jobs.missed(), side.jobs.released);
  };
  const std::string misses = fmt::format("{} instead of {} of all jobs", missed(*all.b), missed(*all.a));
  std::string text;
  switch (all.miss) {
    case Verdict::Better: text = fmt::format("B misses fewer deadlines than A: {}", misses); break;
    case Verdict::Worse: text = fmt::format("B misses more deadlines than A: {}", misses); break;
    case Verdict::Same: text = fmt::format("A and B miss equally many deadlines: {}", misses); break;
    case Verdict::NotTested: text = fmt::format("Too few jobs to compare the misses: {}", misses); break;
  }
  if (better + worse == 0) return text + "; no figure differs significantly";
  const auto counted = [](std::size_t count, const char *what) {
    return fmt::format("{} figure{} {} {}", count, count == 1 ? "" : "s", count == 1 ? "is" : "are", what);
  };
  return fmt::format("{}; {}, {}", text, counted(better, "better"), counted(worse, "worse"));
}

std::string differences_table(const Diffed &diffed, const StreamTraits &terminal, bool all) {
  Table table({{"", false, 9},
               {"jobs", true, 2},
               {"missed", true, 8},
               {"lost", true, 1},
               {"p50", true, 3},
               {"p95", true, 4},
               {"p99", true, 6},
               {"max", true, 5}});
  std::size_t left_out = 0;
  for (const DifferenceRow &row : diffed.difference.rows) {
    if (!all && !is_shown(row, diffed.difference.rows)) {
      ++left_out;
      continue;
    }
    const std::string indent = row.a->task.empty() ? "" : "  ";
    table.add({{indent + (row.a->task.empty() ? row_name(row) : row.a->task),
                row.a->dag.empty() ? Tint::Strong : Tint::Plain},
               {arrow(format_count(row.a->jobs.released), format_count(row.b->jobs.released)), Tint::Faint},
               figure_cell(row, kFigures[0]),
               {arrow(format_count(row.a->jobs.lost()), format_count(row.b->jobs.lost()))},
               figure_cell(row, kFigures[1]),
               figure_cell(row, kFigures[2]),
               figure_cell(row, kFigures[3]),
               {arrow(longest_text(*row.a), longest_text(*row.b)), Tint::Faint}});
  }
  std::string text = table.render(terminal.width, terminal.colour);
  if (left_out > 0)
    text += fmt::format("({} row{} without a difference; --all-tasks shows all)\n", left_out, left_out == 1 ? "" : "s");
  return text;
}

// Returns every figure that differs by more than chance, beginning with those that agree with the conclusion.
std::string findings(const Diffed &diffed, const StreamTraits &terminal) {
  std::string text;
  const bool is_better = diffed.difference.rows.front().miss == Verdict::Better;
  for (const Verdict wanted :
       {is_better ? Verdict::Better : Verdict::Worse, is_better ? Verdict::Worse : Verdict::Better}) {
    for (const DifferenceRow &row : diffed.difference.rows) {
      for (const Figure &figure : kFigures) {
        if (row.*figure.verdict != wanted) continue;
        const FigureDifference &value = row.figures.*figure.value;
        text += fmt::format("{} {}: {} {} -> {} ({})\n", tinted(to_string(wanted), tint_of(wanted), terminal.colour),
                            row_name(row), figure.name, value_text(figure, *row.a, value.a),
                            value_text(figure, *row.b, value.b), change_text(figure, value));
      }
    }
  }
  return text;
}

// True if a figure of the row was not tested. Response times count only where some job has one.
bool is_untested(const DifferenceRow &row) {
  const bool has_times = row.a->has_responses() || row.b->has_responses();
  return std::any_of(kFigures.begin(), kFigures.end(), [&](const Figure &figure) {
    return (is_miss(figure) || has_times) && row.*figure.verdict == Verdict::NotTested;
  });
}

std::vector<std::string> cautions(const Diffed &diffed) {
  std::vector<std::string> list = diffed.warnings;
  std::size_t untested = 0;
  std::vector<std::string> correlated;
  for (const DifferenceRow &row : diffed.difference.rows) {
    if (is_untested(row)) ++untested;
    // Intervals that are too narrow find differences, and hide none.
    if (row.is_correlated() && differs(row)) correlated.push_back(row_name(row));
  }
  // What was found does not become doubtful by what was not tested.
  const bool is_any = diffed.difference.is_any(Verdict::Better) || diffed.difference.is_any(Verdict::Worse);
  if (untested > 0 && !is_any) {
    list.push_back(fmt::format(
        "{} of {} rows have figures that were not tested, because jobs are few or runs are short; run for longer",
        untested, diffed.difference.rows.size()));
  }
  if (!correlated.empty()) {
    list.push_back(fmt::format(
        "{}{}: jobs are correlated beyond the blocks of time that are compared, so the intervals are too narrow; run "
        "for longer",
        correlated.front(), correlated.size() > 1 ? fmt::format(" and {} more", correlated.size() - 1) : ""));
  }
  return list;
}

Json figure_json(const DifferenceRow &row, const Figure &figure) {
  const FigureDifference &value = row.figures.*figure.value;
  const bool tested = value.tested;
  const auto of_side = [&](const DifferenceSide::Row &side, double number) {
    return is_miss(figure) || side.has_responses() ? Json(number) : Json();
  };
  return Json{{"a", of_side(*row.a, value.a)},
              {"b", of_side(*row.b, value.b)},
              {"difference_low", tested ? Json(value.low) : Json()},
              {"difference_high", tested ? Json(value.high) : Json()},
              {"p", tested ? Json(value.p()) : Json()},
              {"verdict", to_string(row.*figure.verdict)}};
}

Json counts_json(const DifferenceSide::Row &row) {
  std::size_t blocks = 0;
  for (const auto &run : row.runs) blocks += run.size();
  return Json{{"released", row.jobs.released},
              {"late", row.jobs.late},
              {"lost", row.jobs.lost()},
              {"missed", row.jobs.missed()},
              {"max_ns", row.has_responses() ? Json(row.max) : Json()},
              {"blocks", blocks}};
}

Json side_json(const DiffSide &side) {
  const trace::RunInfo &first = side.jobs.runs().front();
  Json seeds = Json::array();
  for (const trace::RunInfo &run : side.jobs.runs()) seeds.push_back(run.seed);
  return Json{{"name", side.name},
              {"executor", first.executor},
              {"preemption", first.preemption},
              {"workers", trace::worker_count(first)},
              {"driver", trace::to_string(first.driver)},
              {"runs", side.jobs.runs().size()},
              {"duration_ns", first.end - first.start},
              {"seeds", seeds}};
}

}  // namespace

std::vector<std::string> caveats(const DiffSide &a, const DiffSide &b) {
  std::vector<std::string> list;
  const trace::RunInfo &x = a.jobs.runs().front();
  const trace::RunInfo &y = b.jobs.runs().front();
  if (x.driver != y.driver) {
    list.push_back(
        fmt::format("one side comes from '{}', the other from '{}': what the machine adds is part of the difference",
                    trace::to_string(x.driver), trace::to_string(y.driver)));
  } else if (x.driver != trace::Driver::Simulator && !(x.machine == y.machine)) {
    list.emplace_back("the sides ran on different machines or kernels, which is part of the difference");
  }
  if (x.overheads != y.overheads) {
    const auto said = [](const trace::RunInfo &run) { return run.overheads.empty() ? "none" : run.overheads.c_str(); };
    list.push_back(fmt::format("the sides were charged different overheads: {}, and {}", said(x), said(y)));
  }
  const std::size_t fewest = std::min(a.jobs.runs().size(), b.jobs.runs().size());
  if (fewest == 1 && (x.driver != trace::Driver::Simulator || y.driver != trace::Driver::Simulator)) {
    list.emplace_back(
        "one side has a single run: its intervals do not include the variation between runs on this machine; use "
        "several runs ('redag compare --repeat')");
  }
  for (const DiffSide *side : {&a, &b}) {
    const auto &runs = side->jobs.runs();
    if (std::any_of(runs.begin(), runs.end(), [](const trace::RunInfo &run) { return run.lost_events > 0; })) {
      list.push_back(side->name + " lost events: some of its jobs are missing");
    }
  }
  return list;
}

std::string describe(const Diffed &diffed, const StreamTraits &terminal, bool all) {
  std::string text = tinted(conclusion(diffed), Tint::Strong, terminal.colour) + "\n\nA  " + run_words(diffed.a) +
                     "\nB  " + run_words(diffed.b) + "\n";
  for (const lab::Change &change : diffed.changes)
    text += tinted("differs ", Tint::Strong, terminal.colour) + change.text() + "\n";
  text += "\n" + differences_table(diffed, terminal, all) + "\n" + findings(diffed, terminal);
  text += fmt::format(
      "* significant{}; {} tests; false discovery rate 5 %; 95 % intervals from blocks of time; max is not tested; "
      "times: of a task, finish - release; of a DAG with one sink, end to end; shares: of the jobs of that side\n",
      diffed.options.tolerance > 0
          ? fmt::format(", and for response times by more than {:g} %", 100 * diffed.options.tolerance)
          : "",
      diffed.difference.tests);
  for (const std::string &caution : cautions(diffed)) {
    text += tinted("caution: ", Tint::Caution, terminal.colour) + caution + "\n";
  }
  return text;
}

Json to_json(const Diffed &diffed) {
  Json changes = Json::array();
  for (const lab::Change &change : diffed.changes) {
    changes.push_back(Json{{"kind", change.kind == lab::Change::Kind::Demand ? "demand" : "setting"},
                           {"what", change.what},
                           {"a", change.before},
                           {"b", change.after}});
  }
  Json rows = Json::array();
  for (const DifferenceRow &row : diffed.difference.rows) {
    Json figures = Json::object();
    for (const Figure &figure : kFigures) {
      figures[is_miss(figure) ? "miss_ratio_with_lost" : std::string(figure.name) + "_ns"] = figure_json(row, figure);
    }
    rows.push_back(Json{{"dag", row.a->dag.empty() ? Json() : Json(row.a->dag)},
                        {"task", row.a->task.empty() ? Json() : Json(row.a->task)},
                        {"a", counts_json(*row.a)},
                        {"b", counts_json(*row.b)},
                        {"figures", figures},
                        {"block_correlation", row.figures.block_correlation},
                        {"is_correlated", row.is_correlated()}});
  }
  return Json{{"format", "redag.difference/2"},
              {"a", side_json(diffed.a)},
              {"b", side_json(diffed.b)},
              {"changes", changes},
              {"worse", diffed.difference.is_any(Verdict::Worse)},
              {"better", diffed.difference.is_any(Verdict::Better)},
              {"tolerance", diffed.options.tolerance},
              {"tests", diffed.difference.tests},
              {"p_threshold", diffed.difference.threshold},
              {"rows", rows},
              {"only_one_side", diffed.difference.missing},
              {"cautions", cautions(diffed)}};
}

}  // namespace redag::cli
