// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/difference_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "redag/base/text.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::cli {
namespace {

using lab::DifferenceRow;
using lab::DifferenceSide;
using lab::FigureDifference;
using lab::Verdict;

// The figures of a row, in the order of the table: the misses, then the percentiles of response times.
constexpr std::array kFigures = {"missed", "p50", "p95", "p99"};
constexpr std::size_t kMissed = 0;

const FigureDifference &figure_of(const DifferenceRow &row, std::size_t figure) {
  return figure == kMissed ? row.miss_ratio : row.responses[figure - 1];
}

// False of response times where no job has one: of all jobs together, or of a DAG with several sinks.
bool exists(const DifferenceRow &row, std::size_t figure) {
  return figure == kMissed || row.a->has_responses() || row.b->has_responses();
}

// Returns the text of one side's figure: a response time, or misses with their count.
std::string value_text(std::size_t figure, const DifferenceSide::Row &side, double value) {
  if (figure == kMissed) return format_count_and_share(side.jobs.missed(), side.jobs.released);
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

std::string figure_text(const DifferenceRow &row, std::size_t figure) {
  const FigureDifference &value = figure_of(row, figure);
  return arrow(value_text(figure, *row.a, value.a), value_text(figure, *row.b, value.b));
}

std::string run_words(const DiffSide &side) {
  const std::vector<trace::RunInfo> &runs = side.jobs.runs();
  const trace::RunInfo &first = runs.front();
  return fmt::format("{}: {}, {}, {}, {}, {} of {}", side.name, first.executor, first.preemption,
                     plural(trace::worker_count(first), "worker"), trace::to_string(first.driver),
                     plural(runs.size(), "run"), humanize_duration(first.end - first.start));
}

// Counts the figures of this verdict. Response times count only where some job has one.
std::size_t count_of(const Diffed &diffed, Verdict wanted) {
  std::size_t count = 0;
  for (const DifferenceRow &row : diffed.difference.rows) {
    for (std::size_t f = 0; f < kFigures.size(); ++f) {
      if (exists(row, f) && figure_of(row, f).verdict == wanted) ++count;
    }
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
  switch (all.miss_ratio.verdict) {
    case Verdict::Better: text = fmt::format("B misses fewer deadlines than A: {}", misses); break;
    case Verdict::Worse: text = fmt::format("B misses more deadlines than A: {}", misses); break;
    case Verdict::Same: text = fmt::format("A and B miss equally many deadlines: {}", misses); break;
    case Verdict::NotTested: text = fmt::format("Too few repetitions to compare the misses: {}", misses); break;
  }
  if (better + worse == 0) return text + "; no figure differs significantly";
  const auto counted = [](std::size_t count, const char *what) {
    return fmt::format("{} {}", plural(count, "figure is", "figures are"), what);
  };
  return fmt::format("{}; {}, {}", text, counted(better, "better"), counted(worse, "worse"));
}

// Returns the figures that differ by more than chance, first those that agree with the conclusion; `all`: every figure.
std::string findings(const Diffed &diffed, const StreamTraits &terminal, bool all) {
  const bool is_better = diffed.difference.rows.front().miss_ratio.verdict == Verdict::Better;
  std::vector<Verdict> shown = {is_better ? Verdict::Better : Verdict::Worse,
                                is_better ? Verdict::Worse : Verdict::Better};
  if (all) shown.insert(shown.end(), {Verdict::Same, Verdict::NotTested});
  std::string text;
  for (const Verdict wanted : shown) {
    for (const DifferenceRow &row : diffed.difference.rows) {
      for (std::size_t f = 0; f < kFigures.size(); ++f) {
        if (!exists(row, f) || figure_of(row, f).verdict != wanted) continue;
        text += fmt::format("{} {}: {} {}\n", tinted(to_string(wanted), tint_of(wanted), terminal.colour),
                            row_name(row), kFigures[f], figure_text(row, f));
      }
    }
  }
  const std::size_t hidden = all ? 0 : count_of(diffed, Verdict::Same) + count_of(diffed, Verdict::NotTested);
  if (hidden > 0) text += fmt::format("({} without a difference; --all-tasks shows all)\n", plural(hidden, "figure"));
  return text;
}

std::vector<std::string> cautions(const Diffed &diffed) {
  std::vector<std::string> list = diffed.warnings;
  const std::size_t untested = count_of(diffed, Verdict::NotTested);
  // What was found does not become doubtful by what was not tested.
  const bool is_any = diffed.difference.is_any(Verdict::Better) || diffed.difference.is_any(Verdict::Worse);
  if (untested > 0 && !is_any) {
    list.push_back(fmt::format("{} not tested, because jobs or repetitions are few; run for longer, or more often",
                               plural(untested, "figure")));
  }
  return list;
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
  const bool is_simulated = x.driver == trace::Driver::Simulator && y.driver == trace::Driver::Simulator;
  if (fewest < lab::kFewestRuns && !is_simulated) {
    list.push_back(fmt::format(
        "one side has fewer than {} runs: stretches of time are compared, which do not vary as runs on this "
        "machine do; use several runs ('redag compare --repeat {}')",
        lab::kFewestRuns, lab::kFewestRuns));
  }
  if (x.end - x.start != y.end - y.start) {
    list.emplace_back("the runs differ in length: percentiles of long and of short ones are less comparable");
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
  text += "\n" + findings(diffed, terminal, all) + "\n";
  text += fmt::format(
      "better, worse: by more than chance{} (rank sums of {}, false discovery rate 5 %)\n"
      "times: of a task, finish - release; of a DAG with one sink, end to end\n",
      diffed.tolerance > 0 ? fmt::format(", and for response times by more than {:g} %", 100 * diffed.tolerance) : "",
      diffed.difference.of_runs ? "runs" : "stretches of time");
  for (const std::string &caution : cautions(diffed)) {
    text += tinted("caution: ", Tint::Caution, terminal.colour) + caution + "\n";
  }
  return text;
}

}  // namespace redag::cli
