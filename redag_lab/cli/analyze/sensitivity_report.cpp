// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/sensitivity_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "redag/base/rounded_time.hpp"
#include "redag/base/text.hpp"
#include "redag_analysis/text/footnotes.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

using lab::Knob;
using lab::Margin;
using Kind = lab::Knob::Kind;

constexpr std::size_t kMostRows = 50;

bool is_schedulable(const Sensitivity &sensitivity) {
  return sensitivity.analysed.report.verdict == analysis::Verdict::Schedulable;
}

bool is_of_rates(const Knob &knob) { return knob.kind == Kind::Period || knob.kind == Kind::Rates; }

bool is_of_all(const Sensitivity &sensitivity, const Knob &knob) {
  const std::size_t tasks = sensitivity.analysed.task_set.tasks.size();
  return knob.kind == Kind::AllWcets || (knob.kind == Kind::Rates && knob.tasks.size() == tasks);
}

// Formats a factor, rounded down so as not to overstate the margin.
std::string format_factor(double factor) {
  constexpr double kDigits = 1e4;
  return fmt::format("{:.4f}", std::floor(factor * kDigits + 1e-6) / kDigits);
}

// Returns the value of a knob that turns a single value; nothing for other knobs.
std::optional<Duration> value_at(const Knob &knob, std::int64_t position) {
  if (knob.kind == Kind::Wcet) return position;
  if (knob.kind == Kind::Period) return -position;
  return std::nullopt;
}

// Formats a value, rounded towards less load: a wcet down, a period up.
std::string humanize_safely(const Knob &knob, Duration value) {
  return is_of_rates(knob) ? humanize_up(value) : humanize_down(value);
}

std::string limit_text(const Knob &knob, std::optional<std::int64_t> position) {
  if (!position) return "none";
  const std::optional<Duration> value = value_at(knob, *position);
  return value ? humanize_safely(knob, *value) : "-";
}

std::string nominal_text(const Knob &knob, std::int64_t position) {
  const std::optional<Duration> value = value_at(knob, position);
  return value ? humanize_duration(*value) : "-";
}

std::string factor_text(const std::optional<Margin> &margin) {
  if (!margin) return "";
  return margin->position ? format_factor(margin->factor) : "none";
}

// Names the position above the margin that is accepted again.
std::string again_text(const lab::Analysed &analysed, const Margin &margin) {
  const std::optional<Duration> value = value_at(margin.knob, *margin.again);
  return value ? humanize_duration(*value)
               : "a factor of " + format_factor(load_factor(analysed.workload, margin.knob, *margin.again));
}

std::string obstacle_text(const Margin &margin) {
  return margin.reason.empty() ? margin.obstacle : margin.obstacle + ": " + margin.reason;
}

// Reasons stand below the table: mostly a few of them limit many rows.
std::string table_of(const Sensitivity &sensitivity, const std::vector<const KnobResult *> &rows,
                     const StreamTraits &terminal) {
  Footnotes reasons;
  const bool simulated = sensitivity.simulated_for > 0;
  std::vector<Column> columns = {{"what", false, 9}, {"now", true, 5}, {"limit", true, 7}, {"factor", true, 8}};
  if (simulated) columns.push_back({"simulated", true, 6});
  columns.push_back({.title = "limited by", .importance = 1, .prose = true});
  Table table(columns);
  for (const KnobResult *row : rows) {
    const Margin &margin = row->margin;
    const Tint tint = !margin.position ? Tint::Bad : margin.factor < 1 ? Tint::Caution : Tint::Plain;
    std::vector<Cell> cells = {{knob_name(sensitivity.analysed, margin.knob)},
                               {nominal_text(margin.knob, margin.nominal)},
                               {limit_text(margin.knob, margin.position)},
                               {factor_text(margin), tint}};
    if (simulated) cells.push_back({factor_text(row->simulated), Tint::Faint});
    cells.push_back(
        {margin.obstacle + reasons.mark(margin.reason) + (margin.again ? " (with gaps)" : ""), Tint::Faint});
    table.add(std::move(cells));
  }
  const std::string text = table.render(terminal.width, terminal.colour);
  const bool has_marks = text.find(" [1]") != std::string::npos;  // not where there is no room for them
  return has_marks ? text + reasons.render(terminal.width) : text;
}

// Returns all rows in order, or those with the least margin. Rows about all tasks always remain.
std::vector<const KnobResult *> shown_rows(const Sensitivity &sensitivity, bool all) {
  std::vector<const KnobResult *> rows;
  for (const KnobResult &result : sensitivity.results) rows.push_back(&result);
  if (all || rows.size() <= kMostRows) return rows;
  const auto room = [&](const KnobResult *row) {
    return is_of_all(sensitivity, row->margin.knob) ? -1.0 : row->margin.factor;
  };
  std::stable_sort(rows.begin(), rows.end(),
                   [&](const KnobResult *a, const KnobResult *b) { return room(a) < room(b); });
  rows.resize(kMostRows);
  return rows;
}

// Returns the margin nearest to its limit (or that has to shrink least), among those with a limit.
const Margin *nearest(const Sensitivity &sensitivity, bool rates) {
  const bool yes = is_schedulable(sensitivity);
  const Margin *best = nullptr;
  for (const KnobResult &result : sensitivity.results) {
    const Margin &margin = result.margin;
    if (is_of_rates(margin.knob) != rates || is_of_all(sensitivity, margin.knob) || !margin.position) continue;
    if (best == nullptr || (yes ? margin.factor < best->factor : margin.factor > best->factor)) best = &margin;
  }
  return best;
}

std::string change_of(const lab::Analysed &analysed, const Margin &margin) {
  const std::string name = knob_name(analysed, margin.knob);
  const std::optional<Duration> now = value_at(margin.knob, margin.nominal);
  if (!now) return fmt::format("{}, to {} of its value", name, format_factor(margin.factor));
  return fmt::format("{}, from {} to {}", name, humanize_duration(*now),
                     humanize_safely(margin.knob, *value_at(margin.knob, *margin.position)));
}

std::string words_of_room(const Sensitivity &sensitivity) {
  std::string text;
  for (const KnobResult &result : sensitivity.results) {
    const Margin &margin = result.margin;
    if (!is_of_all(sensitivity, margin.knob)) continue;
    text += fmt::format("all {} together can grow to {} times their values\n",
                        is_of_rates(margin.knob) ? "rates" : "execution times", format_factor(margin.factor));
  }
  if (const Margin *least = nearest(sensitivity, false)) {
    text += "the execution time that can grow least: " + change_of(sensitivity.analysed, *least) + "\n";
  }
  if (const Margin *least = nearest(sensitivity, true)) {
    text += "the rate that can grow least: " + change_of(sensitivity.analysed, *least) + "\n";
  }
  return text;
}

std::string words_of_lack(const Sensitivity &sensitivity) {
  std::string text;
  bool tried_wcet = false;
  bool tried_rate = false;
  for (const KnobResult &result : sensitivity.results) {
    const Margin &margin = result.margin;
    const bool rates = is_of_rates(margin.knob);
    const char *what = rates ? "rates" : "execution times";
    if (!is_of_all(sensitivity, margin.knob)) {
      (rates ? tried_rate : tried_wcet) = true;
    } else if (margin.position) {
      text += fmt::format("to be shown schedulable, all {} together must shrink to {} of their values\n", what,
                          format_factor(margin.factor));
    } else {
      text += fmt::format("shrinking all {} together never suffices: {}\n", what, margin.obstacle);
    }
  }
  const auto say = [&](bool tried, bool rates) {
    if (!tried) return;
    const Margin *least = nearest(sensitivity, rates);
    text += least == nullptr ? fmt::format("changing a single one of the {} examined does not suffice\n",
                                           rates ? "rates" : "execution times")
                             : fmt::format("changing one alone suffices; the smallest change: {}\n",
                                           change_of(sensitivity.analysed, *least));
  };
  say(tried_wcet, false);
  say(tried_rate, true);
  return text;
}

Json margin_json(const Margin &margin) {
  const auto value = [&](std::optional<std::int64_t> position) {
    const std::optional<Duration> found = position ? value_at(margin.knob, *position) : std::nullopt;
    return found ? Json(*found) : Json();
  };
  return Json{{"limit_ns", value(margin.position)},
              {"factor", margin.position ? Json(margin.factor) : Json()},
              {"monotone", !margin.again},
              {"again_ns", value(margin.again)},
              {"tests", margin.tested}};
}

const char *kind_name(Kind kind) {
  switch (kind) {
    case Kind::Wcet: return "wcet";
    case Kind::AllWcets: return "all_wcets";
    case Kind::Period: return "period";
    case Kind::Rates: return "rates";
  }
  return "?";
}

}  // namespace

std::string knob_name(const lab::Analysed &analysed, const Knob &knob) {
  if (knob.kind == Kind::AllWcets) return "all wcets";
  if (knob.kind == Kind::Wcet) return "wcet of " + task_name(analysed, TaskId(knob.tasks.front()));
  if (knob.kind == Kind::Rates && knob.tasks.size() == analysed.task_set.tasks.size()) return "all rates";
  const std::string what = knob.kind == Kind::Period ? "period of " : "rates of ";
  const analysis::CompiledDag &dag = analysed.task_set.dags[analysed.task_set.tasks[knob.tasks.front()].dag.value];
  if (knob.tasks.size() == dag.tasks.size()) return what + dag.name;
  const std::string more = knob.tasks.size() > 1 ? fmt::format(" and {} more", knob.tasks.size() - 1) : "";
  return what + task_name(analysed, TaskId(knob.tasks.front())) + more;
}

std::string in_words(const Sensitivity &sensitivity) {
  std::string text = is_schedulable(sensitivity) ? words_of_room(sensitivity) : words_of_lack(sensitivity);
  for (const KnobResult &result : sensitivity.results) {
    if (!result.simulated || !result.simulated->position || !is_of_all(sensitivity, result.margin.knob)) continue;
    text += fmt::format("in simulation (no proof), all {} together can grow to {} times their values\n",
                        is_of_rates(result.margin.knob) ? "rates" : "execution times",
                        format_factor(result.simulated->factor));
  }
  for (const KnobResult &result : sensitivity.results) {
    if (!result.margin.again) continue;
    text += fmt::format("with gaps: {} passes again at {}, above its limit; every value tried below the limit passes\n",
                        knob_name(sensitivity.analysed, result.margin.knob),
                        again_text(sensitivity.analysed, result.margin));
  }
  if (sensitivity.results.size() < sensitivity.knobs) {
    text += fmt::format("stopped after {} of {}\n", sensitivity.results.size(), sensitivity.knobs);
  }
  return text;
}

std::string describe(const Sensitivity &sensitivity, const StreamTraits &terminal, bool all) {
  const lab::Analysed &analysed = sensitivity.analysed;
  const std::string reason = mode_reason(analysed);
  std::string text = fmt::format("{}: {}, {} worker{}, utilization {:.3f}\npreemption: {}{}\n", analysed.workload.name,
                                 to_string(analysed.workload.policy), analysed.task_set.platform.workers,
                                 analysed.task_set.platform.workers == 1 ? "" : "s", analysed.task_set.utilization,
                                 mode_name(analysed), reason.empty() ? "" : " (" + reason + ")");
  const std::string verdict = verdict_in_words(analysed);
  const std::size_t colon = verdict.find(':');
  const Tint tint = is_schedulable(sensitivity) ? Tint::Good : Tint::Bad;
  text += tinted(verdict.substr(0, colon), tint, terminal.colour) + verdict.substr(colon) + "\n\n";
  const std::vector<const KnobResult *> rows = shown_rows(sensitivity, all);
  text += table_of(sensitivity, rows, terminal);
  if (rows.size() < sensitivity.results.size()) {
    text += fmt::format("(the {} of {} that can grow least; --all-tasks shows all)\n", rows.size(),
                        format_count(sensitivity.results.size()));
  }
  std::uint64_t tests = 0;
  for (const KnobResult &result : sensitivity.results) tests += result.margin.tested;
  text += fmt::format(
      "\nlimit: the value with the largest load at which all deadlines are shown to be met, as in every test with "
      "less load; rounded to four digits towards less load (--json has every nanosecond)\n"
      "factor: load at the limit / present load, rounded down\n"
      "{} analyses\n",
      format_count(tests));
  if (sensitivity.simulated_for > 0) {
    text += fmt::format("simulated: no miss in {} with these offsets and full execution times: no proof\n",
                        format_duration(sensitivity.simulated_for));
  }
  return text + "\n" + in_words(sensitivity);
}

Json to_json(const Sensitivity &sensitivity) {
  const lab::Analysed &analysed = sensitivity.analysed;
  Json document = {{"format", "redag.sensitivity/1"},
                   {"workload", analysed.workload.name},
                   {"policy", to_string(analysed.workload.policy)},
                   {"workers", analysed.task_set.platform.workers},
                   {"preemption", mode_name(analysed)},
                   {"preemption_why", mode_reason(analysed)},
                   {"utilization", analysed.task_set.utilization},
                   {"schedulable", is_schedulable(sensitivity)},
                   {"verdict", verdict_in_words(analysed)},
                   {"resolution", {{"time_ns", 1}, {"factor", 1.0 / lab::kFactorUnit}}},
                   {"probes", sensitivity.probes},
                   {"simulated_ns", sensitivity.simulated_for > 0 ? Json(sensitivity.simulated_for) : Json()},
                   {"stopped", sensitivity.results.size() < sensitivity.knobs},
                   {"text", in_words(sensitivity)}};
  document["limits"] = Json::array();
  for (const KnobResult &result : sensitivity.results) {
    const Margin &margin = result.margin;
    const std::optional<Duration> now = value_at(margin.knob, margin.nominal);
    Json row = {{"name", knob_name(analysed, margin.knob)},
                {"kind", kind_name(margin.knob.kind)},
                {"now_ns", now ? Json(*now) : Json()}};
    row.update(margin_json(margin));
    row["obstacle"] = obstacle_text(margin);
    row["tasks"] = Json::array();
    for (const std::uint32_t t : margin.knob.tasks) row["tasks"].push_back(task_name(analysed, TaskId(t)));
    row["simulated"] = result.simulated ? margin_json(*result.simulated) : Json();
    document["limits"].push_back(std::move(row));
  }
  return document;
}

}  // namespace redag::cli
