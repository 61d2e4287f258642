// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/import/verdict_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/tint.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::cli {
namespace {

using lab::Outcome;

std::string share_missed(std::uint64_t missed, std::uint64_t released) {
  if (missed == 0) return "none";
  return format_percent(static_cast<double>(missed) / static_cast<double>(released));
}

/// A callback, or a chain that ends with it, under one executor.
struct Figures {
  const metrics::Distribution *response = nullptr;
  const metrics::JobCounts *jobs = nullptr;  // of callbacks
  bool is_shown = false;
};

struct Line {
  std::string name;
  std::vector<Figures> figures;  // by outcome
};

std::vector<Line> lines_of(const lab::WhatIf &verdict, const Workload &workload) {
  std::vector<Line> lines;
  for (const TaskRef &ref : flatten(workload)) {
    if (!verdict.refused[ref.id.value].empty()) continue;
    Line &line = lines.emplace_back(Line{ref.task->name, {}});
    for (const Outcome &outcome : verdict.outcomes) {
      const metrics::JobStats &jobs = outcome.summary.tasks[ref.id.value].jobs;
      line.figures.push_back({&jobs.response, &jobs, outcome.held[ref.id.value]});
    }
  }
  // A chain has a verdict where all its callbacks have one.
  std::size_t first = 0;
  for (std::size_t dag = 0; dag < workload.dags.size(); ++dag) {
    const std::vector<Task> &tasks = workload.dags[dag].tasks;
    const auto begin = verdict.refused.begin() + static_cast<std::ptrdiff_t>(first);
    const bool is_judged = std::all_of(begin, begin + static_cast<std::ptrdiff_t>(tasks.size()),
                                       [](const std::string &reason) { return reason.empty(); });
    const std::size_t sinks = verdict.outcomes.front().summary.dags[dag].end_to_end.sinks.size();
    for (std::size_t sink = 0; is_judged && tasks.size() > 1 && sink < sinks; ++sink) {
      Line &line = lines.emplace_back();
      for (const Outcome &outcome : verdict.outcomes) {
        const metrics::SinkSummary &end = outcome.summary.dags[dag].end_to_end.sinks[sink];
        line.name = "age at " + tasks[end.task.value - first].name;
        line.figures.push_back({&end.response, nullptr, false});
      }
    }
    first += tasks.size();
  }
  return lines;
}

/// Leaves room for the figures: they need 60 columns.
std::string fitting_name(std::string name, std::size_t width) {
  constexpr std::string_view kObvious = " subscription";
  if (const std::size_t at = name.find(kObvious); at != std::string::npos) name.erase(at, kObvious.size());
  return width == 0 ? name : cut(name, std::max<std::size_t>(width, 72) - 60);
}

std::string short_name(const Outcome &outcome) {
  return outcome.executor.starts_with("redag-") ? outcome.executor.substr(6) : outcome.executor;
}

std::string figures_of(const Outcome &outcome, std::size_t judged) {
  return fmt::format("{} missed, {} of {} deadlines shown, largest p99 {} of its deadline",
                     share_missed(outcome.missed, outcome.released), outcome.shown, judged,
                     format_percent(outcome.worst_response));
}

/// Callbacks and executors, and under them what each executor does.
std::string outcomes_of(const lab::WhatIf &verdict, const Workload &workload, const StreamTraits &terminal) {
  const std::size_t executors = verdict.outcomes.size() / 2;
  const std::uint32_t other = verdict.outcomes[executors].workers;
  Table table({{.title = "callback", .importance = 9},
               {.title = "by", .importance = 9},
               {"p50", true, 5},
               {"p99", true, 7},
               {"missed", true, 8},
               {.title = "shown", .importance = 6},
               {fmt::format("{}: p99", other), true, 3},
               {fmt::format("{}: miss", other), true, 4}});
  for (const Line &line : lines_of(verdict, workload)) {
    for (std::size_t i = 0; i < executors; ++i) {
      const auto missed = [](const Figures &figures) {
        if (figures.jobs == nullptr) return Cell{"-"};
        const std::uint64_t count = figures.jobs->missed();
        return Cell{share_missed(count, figures.jobs->released), count > 0 ? Tint::Bad : Tint::Good};
      };
      const Figures &now = line.figures[i];
      const Figures &then = line.figures[i + executors];
      table.add({{i == 0 ? fitting_name(line.name, terminal.width) : ""},
                 {short_name(verdict.outcomes[i])},
                 {humanize_duration(now.response->p50)},
                 {humanize_duration(now.response->p99)},
                 missed(now),
                 {now.is_shown ? "yes" : "-"},
                 {humanize_duration(then.response->p99)},
                 missed(then)});
    }
  }
  std::string text = table.render(terminal.width, terminal.colour);
  text += fmt::format(
      "On {}, and behind \"{}:\" on {}. none and os: ReDAG-RT, by its preemption. missed: late or skipped. shown: the "
      "deadline is met in every case, if no run is longer than the longest recorded one. age: from the release of the "
      "source.\n\n",
      plural(verdict.outcomes.front().workers, "thread"), other, other);
  for (std::size_t i = 0; i < verdict.outcomes.size(); ++i) {
    const Outcome &outcome = verdict.outcomes[i];
    text += fmt::format("{} on {}: {}\n", short_name(outcome), outcome.workers, figures_of(outcome, verdict.judged()));
  }
  return text;
}

}  // namespace

std::string describe(const lab::SelfCheck &check, const StreamTraits &terminal) {
  Table table({{.title = "response of", .importance = 9},
               {"p50", true, 5},
               {"simulated", true, 5},
               {"p99", true, 6},
               {"simulated", true, 6},
               {.title = ""}});
  std::size_t wrong = 0;
  for (const lab::ReproducedTask &task : check.tasks) {
    if (!task.is_reproduced()) ++wrong;
    table.add({{task.name},
               {humanize_duration(task.recorded.p50)},
               {humanize_duration(task.simulated.p50)},
               {humanize_duration(task.recorded.p99)},
               {humanize_duration(task.simulated.p99)},
               {task.is_reproduced() ? "" : "differs", Tint::Bad}});
  }
  std::string text = table.render(terminal.width, terminal.colour);
  text += fmt::format(
      "The model of {} reproduces {} of {}: p50 within 10 % or {}, p99 within 25 % or {}. An idle thread of the "
      "recording wakes up that late (median, 99 %). Trust no comparison of the others.\n",
      check.executor, check.tasks.size() - wrong, plural(check.tasks.size(), "recorded response"),
      humanize_duration(check.noise.p50), humanize_duration(check.noise.p99));
  if (!check.unknown.empty()) {
    text += fmt::format("unknown: when jobs of {} were released\n", join_first(check.unknown, 5));
  }
  return text;
}

std::string describe(const lab::WhatIf &verdict, const Workload &workload, const StreamTraits &terminal) {
  std::string refused;
  for (const TaskRef &ref : flatten(workload)) {
    const std::string &reason = verdict.refused[ref.id.value];
    if (!reason.empty()) refused += fmt::format("  {}: {}\n", ref.task->name, reason);
  }
  if (!refused.empty()) refused = "No verdict, because the model does not reproduce the recording:\n" + refused;
  if (verdict.judged() == 0) return refused;
  std::string text = outcomes_of(verdict, workload, terminal) + "\n";
  if (!refused.empty()) text += refused + "\n";
  text += verdict.changes.empty() ? "No single change that was tried makes the recorded robot better.\n"
                                  : "What would help most, each alone and checked:\n";
  for (const lab::TriedChange &change : verdict.changes) {
    text += fmt::format("  {}: {}\n", change.words, figures_of(change.outcome, verdict.judged()));
  }
  return text;
}

Json to_json(const lab::WhatIf &verdict, const Workload &workload) {
  const auto totals = [&](const Outcome &outcome) {
    return Json{{"executor", outcome.executor}, {"workers", outcome.workers},
                {"released", outcome.released}, {"missed", outcome.missed},
                {"shown", outcome.shown},       {"worst_p99_share", outcome.worst_response}};
  };
  const std::vector<Line> lines = lines_of(verdict, workload);
  Json outcomes = Json::array();
  for (std::size_t i = 0; i < verdict.outcomes.size(); ++i) {
    Json rows = Json::array();
    for (const Line &line : lines) {
      const Figures &figures = line.figures[i];
      Json row{{"name", line.name}, {"p50_ns", figures.response->p50}, {"p99_ns", figures.response->p99}};
      if (figures.jobs != nullptr) {
        row.update(Json{
            {"released", figures.jobs->released}, {"missed", figures.jobs->missed()}, {"shown", figures.is_shown}});
      }
      rows.push_back(std::move(row));
    }
    outcomes.push_back(totals(verdict.outcomes[i]));
    outcomes.back()["rows"] = std::move(rows);
  }
  Json refused = Json::array();
  for (const TaskRef &ref : flatten(workload)) {
    const std::string &reason = verdict.refused[ref.id.value];
    if (!reason.empty()) refused.push_back(Json{{"name", ref.task->name}, {"reason", reason}});
  }
  Json changes = Json::array();
  for (const lab::TriedChange &change : verdict.changes) {
    Json row{{"change", change.words}};
    row.update(totals(change.outcome));
    changes.push_back(std::move(row));
  }
  return Json{{"format", "redag.verdict/1"},   {"workload", workload.name},       {"judged", verdict.judged()},
              {"refused", std::move(refused)}, {"outcomes", std::move(outcomes)}, {"changes", std::move(changes)}};
}

}  // namespace redag::cli
