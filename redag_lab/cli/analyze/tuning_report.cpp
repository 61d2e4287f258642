// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/tuning_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <span>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/analyze/score_text.hpp"
#include "redag_lab/workload/changes.hpp"

namespace redag::cli {
namespace {

using lab::ClassScore;
using lab::Objective;
using lab::Point;
using lab::RunScore;
using lab::SettingCandidate;
using lab::Tuned;

constexpr std::size_t kMostTrials = 10;
constexpr Criticality kByUrgency[] = {Criticality::High, Criticality::Normal, Criticality::Low};

double miss_ratio(const ClassScore &score) {
  return score.released == 0 ? 0 : static_cast<double>(score.missed) / static_cast<double>(score.released);
}

std::string miss_text(const ClassScore &score) {
  return score.missed == 0 ? "none"
                           : fmt::format("{} ({})", format_count(score.missed), format_percent(miss_ratio(score)));
}

std::string objective_text(const ClassScore &score, Objective objective) {
  switch (objective) {
    case Objective::Misses: return miss_text(score);
    case Objective::Lateness:
      return fmt::format("{} lost, {}", format_count(score.lost), lateness_text(score.extremes));
    case Objective::Slack: return fmt::format("{} lost, {}", format_count(score.lost), slack_text(score.extremes));
  }
  return "?";
}

bool has_classes(const RunScore &score) {
  return std::count_if(score.of.begin(), score.of.end(), [](const ClassScore &each) { return each.released > 0; }) > 1;
}

std::vector<Cell> score_cells(const RunScore &score, bool bounds) {
  const ClassScore all = score.all();
  return {{bounds ? (score.proven ? "yes" : "no") : "-", score.proven ? Tint::Good : Tint::Plain},
          {miss_text(all), all.missed > 0 ? Tint::Bad : Tint::Good},
          {format_count(all.lost)},
          {lateness_text(all.extremes)},
          {slack_text(all.extremes)}};
}

// Formats the tie order of the point, a Lehmer code. Zeros stand for the order of the file.
std::string ties_text(const Workload &workload, const Point &point) {
  const auto first = point.begin() + 1 + static_cast<std::ptrdiff_t>(workload.dags.size());
  if (std::all_of(first, point.end(), [](std::uint32_t digit) { return digit == 0; })) return "as it is";
  return fmt::format("{}", fmt::join(first, point.end(), "."));
}

std::string scores_table(const Tuning &tuning, const StreamTraits &terminal) {
  Table table({{"", false, 9},
               {"seeds", false, 3},
               {"proven", false, 5},
               {"missed", true, 8},
               {"lost", true, 2},
               {"max lateness", true, 7},
               {"least slack", true, 6}});
  const auto add = [&](const char *title, const char *seeds, const RunScore &score) {
    std::vector<Cell> cells = {{title}, {seeds}};
    for (Cell &cell : score_cells(score, tuning.options.bounds)) cells.push_back(std::move(cell));
    table.add(std::move(cells));
  };
  const Tuned &tuned = tuning.tuned;
  add("present", "searched", tuned.present.score);
  if (tuned.found.point != tuned.present.point) add("found", "searched", tuned.found.score);
  if (tuning.options.held_out > 0) {
    add("present", "unseen", tuned.present.held_out);
    if (tuned.found.point != tuned.present.point) add("found", "unseen", tuned.found.held_out);
  }
  return table.render(terminal.width, terminal.colour);
}

using Ranked = std::vector<std::pair<Point, RunScore>>;

Ranked ranked(const Tuning &tuning) {
  Ranked trials(tuning.tuned.trials.begin(), tuning.tuned.trials.end());
  std::stable_sort(trials.begin(), trials.end(), [&](const auto &a, const auto &b) {
    return lab::is_better(a.second, b.second, tuning.options.goal);
  });
  return trials;
}

std::string trials_table(const Tuning &tuning, const Ranked &trials, const StreamTraits &terminal) {
  const Workload &workload = tuning.tuned.present.workload;
  Table table({{"workers", true, 8},
               {.title = "max_active", .importance = 9, .prose = true},
               {"tie order", false, 1},
               {"proven", false, 5},
               {"missed", true, 8},
               {"lost", true, 2},
               {"max lateness", true, 7},
               {"least slack", true, 6}});
  for (const auto &[point, score] : trials) {
    std::vector<Cell> cells = {{fmt::format("{}", point.front())},
                               {caps_text(workload, std::span(point).subspan(1, workload.dags.size()))},
                               {ties_text(workload, point)}};
    for (Cell &cell : score_cells(score, tuning.options.bounds)) cells.push_back(std::move(cell));
    table.add(std::move(cells));
  }
  return table.render(terminal.width, terminal.colour);
}

std::string tried_tables(const Tuning &tuning, const StreamTraits &terminal, bool all) {
  const Ranked trials = ranked(tuning);
  if (trials.size() < 2) return {};
  std::map<std::uint32_t, std::pair<Point, RunScore>> by_workers;
  for (const auto &trial : trials) by_workers.emplace(trial.first.front(), trial);
  std::string text;
  if (by_workers.size() > 1) {
    Ranked best;
    for (const auto &[workers, trial] : by_workers) best.push_back(trial);
    text +=
        "\n"
        "best setting for each number of workers\n" +
        trials_table(tuning, best, terminal);
  }
  const std::size_t shown = all ? trials.size() : std::min(trials.size(), kMostTrials);
  text += fmt::format(
      "\n"
      "settings tried: {} of {}, best first\n",
      format_count(shown), format_count(trials.size()));
  text += trials_table(tuning, {trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(shown)}, terminal);
  if (shown < trials.size()) text += "(--all-trials shows all)\n";
  return text;
}

struct Pairs {
  std::size_t better = 0;
  std::size_t equal = 0;
  std::size_t worse = 0;
};

// Compares the two settings seed by seed; both had the same jobs.
Pairs compare_runs(const Tuning &tuning) {
  Pairs pairs;
  const std::vector<RunScore> &before = tuning.tuned.present.held_out_runs;
  const std::vector<RunScore> &after = tuning.tuned.found.held_out_runs;
  for (std::size_t i = 0; i < std::min(before.size(), after.size()); ++i) {
    if (lab::improves(after[i], before[i], tuning.options.goal)) {
      ++pairs.better;
    } else if (lab::improves(before[i], after[i], tuning.options.goal)) {
      ++pairs.worse;
    } else {
      ++pairs.equal;
    }
  }
  return pairs;
}

std::string gains(const Tuning &tuning) {
  const Tuned &tuned = tuning.tuned;
  const Objective objective = tuning.options.goal.objective;
  const bool held = tuning.options.held_out > 0;
  const RunScore &before = held ? tuned.present.held_out : tuned.present.score;
  const RunScore &after = held ? tuned.found.held_out : tuned.found.score;
  std::string text;
  if (!before.proven && after.proven) text += "gain: the bounds now prove that every deadline is met\n";
  text += fmt::format("{}, {}: {} -> {}\n", objective_name(objective),
                      held ? "on unseen seeds" : "on the seeds of the search (no validation)",
                      objective_text(before.all(), objective), objective_text(after.all(), objective));
  if (has_classes(before)) {
    for (const Criticality c : kByUrgency) {
      const ClassScore &x = before.of[static_cast<std::size_t>(c)];
      const ClassScore &y = after.of[static_cast<std::size_t>(c)];
      if (x.released == 0) continue;
      text += fmt::format("  criticality {}: {} -> {}\n", to_string(c), objective_text(x, objective),
                          objective_text(y, objective));
    }
  }
  if (held) {
    const Pairs pairs = compare_runs(tuning);
    text += fmt::format("seed by seed: {} better, {} equal, {} worse\n", pairs.better, pairs.equal, pairs.worse);
  }
  return text;
}

Json class_json(const ClassScore &score) {
  return Json{{"released", score.released},
              {"missed", score.missed},
              {"lost", score.lost},
              {"max_lateness_ns", score.extremes.any ? Json(score.extremes.worst_lateness) : Json()},
              {"least_slack", score.extremes.any ? Json(score.extremes.least_slack) : Json()}};
}

Json score_json(const RunScore &score, bool bounds) {
  Json json = class_json(score.all());
  json["proven"] = bounds ? Json(score.proven) : Json();
  json["criticality"] = Json::object();
  for (const Criticality c : kByUrgency)
    json["criticality"][to_string(c)] = class_json(score.of[static_cast<std::size_t>(c)]);
  return json;
}

Json setting_json(const Workload &workload, const Point &point) {
  Json caps = Json::object();
  for (std::size_t d = 0; d < workload.dags.size(); ++d) caps[workload.dags[d].name] = point[1 + d];
  return Json{{"workers", point.front()},
              {"max_active", caps},
              {"tie_order", std::vector<std::uint32_t>(
                                point.begin() + 1 + static_cast<std::ptrdiff_t>(workload.dags.size()), point.end())}};
}

Json candidate_json(const SettingCandidate &candidate, const Tuning &tuning) {
  const bool bounds = tuning.options.bounds;
  Json json = setting_json(candidate.workload, candidate.point);
  json["searched"] = score_json(candidate.score, bounds);
  json["held_out"] = tuning.options.held_out > 0 ? score_json(candidate.held_out, bounds) : Json();
  json["held_out_runs"] = Json::array();
  for (const RunScore &run : candidate.held_out_runs) json["held_out_runs"].push_back(class_json(run.all()));
  return json;
}

}  // namespace

const char *objective_name(Objective objective) {
  return objective == Objective::Lateness ? "max_lateness" : to_string(objective);
}

std::vector<std::string> changes(const Tuned &tuned) {
  std::vector<std::string> list;
  for (const lab::Change &change : lab::changes_between(tuned.present.workload, tuned.best.workload))
    list.push_back(change.text());
  return list;
}

std::string in_words(const Tuning &tuning) {
  const Tuned &tuned = tuning.tuned;
  std::string text;
  if (tuned.changed()) {
    text += gains(tuning);
  } else if (tuned.rejected()) {
    text += "nothing to change: the best setting of the search is worse on the unseen seeds\n" + gains(tuning);
  } else {
    text += fmt::format("nothing to change: no other setting that was tried is better by {}\n",
                        objective_name(tuning.options.goal.objective));
  }
  if (!tuned.varies) {
    text +=
        "runs with different seeds are equal, because execution times and jitter do not vary: no validation is "
        "needed\n";
  }
  if (!tuned.exhaustive) {
    text +=
        fmt::format("found by local search (seed {}), not all combinations were tried\n", tuning.options.effort.seed);
  }
  if (tuned.stopped) text += fmt::format("stopped after {} settings\n", format_count(tuned.trials.size()));
  return text;
}

std::string describe(const Tuning &tuning, const StreamTraits &terminal, bool all) {
  const Workload &workload = tuning.tuned.present.workload;
  const lab::TuneOptions &options = tuning.options;
  std::string text = fmt::format("{}: {}, {} worker{}; objective: {}{}\n", workload.name, to_string(workload.policy),
                                 workload.platform.workers, workload.platform.workers == 1 ? "" : "s",
                                 objective_name(options.goal.objective),
                                 options.goal.per_criticality ? ", the most critical DAGs first" : "");
  text += fmt::format(
      "simulated {} with {}; validated on {} unseen seed{}; {}\n"
      "\n",
      humanize_duration(options.simulation.duration),
      options.seeds == 1 ? std::string("one seed") : fmt::format("each of {} seeds", options.seeds), options.held_out,
      options.held_out == 1 ? "" : "s",
      options.bounds ? "settings that the bounds prove come first" : "bounds are not used");
  text += scores_table(tuning, terminal);
  text += tried_tables(tuning, terminal, all) + "\n";
  for (const std::string &change : changes(tuning.tuned)) {
    text += tinted("change ", Tint::Strong, terminal.colour) + change + "\n";
  }
  return text + in_words(tuning);
}

Json to_json(const Tuning &tuning) {
  const Tuned &tuned = tuning.tuned;
  const lab::TuneOptions &options = tuning.options;
  Json trials = Json::array();
  for (const auto &[point, score] : tuned.trials) {
    Json row = setting_json(tuned.present.workload, point);
    row.update(score_json(score, options.bounds));
    trials.push_back(std::move(row));
  }
  return Json{{"format", "redag.tuning/1"},
              {"workload", tuned.present.workload.name},
              {"objective", objective_name(options.goal.objective)},
              {"per_criticality", options.goal.per_criticality},
              {"duration_ns", options.simulation.duration},
              {"seed", options.seed},
              {"seeds", options.seeds},
              {"held_out", options.held_out},
              {"changes", changes(tuned)},
              {"text", in_words(tuning)},
              {"changed", tuned.changed()},
              {"rejected", tuned.rejected()},
              {"exhaustive", tuned.exhaustive},
              {"stopped", tuned.stopped},
              {"varies", tuned.varies},
              {"present", candidate_json(tuned.present, tuning)},
              {"found", candidate_json(tuned.found, tuning)},
              {"best", candidate_json(tuned.best, tuning)},
              {"trials", trials}};
}

}  // namespace redag::cli
