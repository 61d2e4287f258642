// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/tuning_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/workload/changes.hpp"

namespace redag::cli {
namespace {

using lab::Judge;
using lab::Point;
using lab::Score;
using lab::SettingCandidate;
using lab::SettingSpace;
using lab::Tuned;

constexpr std::size_t kMostTrials = 10;

// Returns "12.3 %", rounded down so as not to overstate it; "-" if nothing was seen.
std::string slack_text(const Score &score) {
  return score.slack ? fmt::format("{:.1f} %", std::floor(*score.slack * 1000 + 1e-9) / 10) : "-";
}

// Returns "control 1, lidar none": max_active by DAG. A DAG of one task without a bound has no choice and is left out.
std::string caps_text(const Workload &workload, std::span<const std::uint32_t> caps) {
  std::string text;
  for (std::size_t d = 0; d < caps.size(); ++d) {
    if (workload.dags[d].tasks.size() < 2 && caps[d] == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", workload.dags[d].name, lab::bound_text(caps[d]));
  }
  return text.empty() ? "-" : text;
}

double miss_ratio(const Score &score) {
  return score.judged == 0 ? 0 : static_cast<double>(score.missed) / static_cast<double>(score.judged);
}

std::string miss_text(const Score &score) {
  return score.missed == 0 ? "none"
                           : fmt::format("{} ({})", format_count(score.missed), format_percent(miss_ratio(score)));
}

// Returns what decides between two settings.
std::string goal_text(const Score &score, const lab::TuneOptions &options) {
  if (options.judge == Judge::Simulation) return miss_text(score);
  return fmt::format("{} without a bound, {}", format_count(score.lost), slack_text(score));
}

std::vector<Cell> score_cells(const Score &score) {
  return {{score.proven ? "yes" : "no", score.proven ? Tint::Good : Tint::Plain},
          {miss_text(score), score.missed > 0 ? Tint::Bad : Tint::Good},
          {format_count(score.lost)},
          {slack_text(score)}};
}

// Returns the columns of score_cells(). Jobs miss deadlines; of bounds, deadlines are not shown to be met.
std::vector<Column> score_columns(const Tuning &tuning) {
  const bool by_bounds = tuning.options.judge == Judge::Bounds;
  return {{"proven", false, 5},
          {by_bounds ? "not shown" : "missed", true, 8},
          {by_bounds ? "no bound" : "lost", true, 2},
          {"least slack", true, 7}};
}

Table table_of(std::vector<Column> columns, const Tuning &tuning) {
  for (Column &column : score_columns(tuning)) columns.push_back(std::move(column));
  return Table(std::move(columns));
}

std::string scores_table(const Tuning &tuning, const StreamTraits &terminal) {
  Table table = table_of({{"", false, 9}, {"judged by", false, 3}}, tuning);
  const auto add = [&](const char *title, const char *seeds, const Score &score) {
    std::vector<Cell> cells = {{title}, {seeds}};
    for (Cell &cell : score_cells(score)) cells.push_back(std::move(cell));
    table.add(std::move(cells));
  };
  const Tuned &tuned = tuning.tuned;
  const char *judge = tuning.options.judge == Judge::Bounds ? "bounds" : "seeds";
  add("present", judge, tuned.present.score);
  if (tuned.found.point != tuned.present.point) add("found", judge, tuned.found.score);
  if (tuning.options.held_out > 0) {
    add("present", "unseen seeds", tuned.present.held_out);
    if (tuned.found.point != tuned.present.point) add("found", "unseen seeds", tuned.found.held_out);
  }
  return table.render(terminal.width, terminal.colour);
}

using Ranked = std::vector<std::pair<Point, Score>>;

Ranked ranked(const Tuning &tuning) {
  Ranked trials(tuning.tuned.trials.begin(), tuning.tuned.trials.end());
  std::stable_sort(trials.begin(), trials.end(), [&](const auto &a, const auto &b) {
    return lab::is_better(a.second, b.second, tuning.options.judge);
  });
  return trials;
}

std::string trials_table(const Tuning &tuning, const Ranked &trials, const StreamTraits &terminal) {
  const Workload &workload = tuning.tuned.present.workload;
  Table table = table_of(
      {{"workers", true, 8}, {"priorities", false, 8}, {.title = "max_active", .importance = 9, .prose = true}},
      tuning);
  for (const auto &[point, score] : trials) {
    std::vector<Cell> cells = {{fmt::format("{}", point.front())},
                               {tuning.tuned.orders[point[SettingSpace::kOrder]]},
                               {caps_text(workload, std::span(point).subspan(SettingSpace::kCaps))}};
    for (Cell &cell : score_cells(score)) cells.push_back(std::move(cell));
    table.add(std::move(cells));
  }
  return table.render(terminal.width, terminal.colour);
}

std::string tried_tables(const Tuning &tuning, const StreamTraits &terminal, bool all) {
  const Ranked trials = ranked(tuning);
  if (trials.size() < 2) return {};
  const std::size_t shown = all ? trials.size() : std::min(trials.size(), kMostTrials);
  std::string text = fmt::format(
      "\n"
      "settings tried: {} of {}, best first\n",
      format_count(shown), format_count(trials.size()));
  text += trials_table(tuning, {trials.begin(), trials.begin() + static_cast<std::ptrdiff_t>(shown)}, terminal);
  if (shown < trials.size()) text += "(--all-trials shows all)\n";
  return text;
}

std::string gains(const Tuning &tuning) {
  const Tuned &tuned = tuning.tuned;
  const bool held = tuning.options.held_out > 0;
  const Score &before = held ? tuned.present.held_out : tuned.present.score;
  const Score &after = held ? tuned.found.held_out : tuned.found.score;
  std::string text;
  if (!before.proven && after.proven) text += "gain: the bounds now prove that every deadline is met\n";
  text += fmt::format("{}: {} -> {}\n",
                      tuning.options.judge == Judge::Bounds ? "least slack, by the bounds"
                      : held                                ? "misses, on unseen seeds"
                                                            : "misses, on the seeds of the search (no validation)",
                      goal_text(before, tuning.options), goal_text(after, tuning.options));
  return text;
}

Json score_json(const Score &score) {
  return Json{{"proven", score.proven},
              {"released", score.judged},
              {"missed", score.missed},
              {"lost", score.lost},
              {"least_slack", score.slack ? Json(*score.slack) : Json()}};
}

Json setting_json(const Tuning &tuning, const Point &point) {
  const Workload &workload = tuning.tuned.present.workload;
  Json caps = Json::object();
  for (std::size_t d = 0; d < workload.dags.size(); ++d) caps[workload.dags[d].name] = point[SettingSpace::kCaps + d];
  return Json{{"workers", point.front()},
              {"priorities", tuning.tuned.orders[point[SettingSpace::kOrder]]},
              {"max_active", caps}};
}

Json candidate_json(const SettingCandidate &candidate, const Tuning &tuning) {
  Json json = setting_json(tuning, candidate.point);
  json["searched"] = score_json(candidate.score);
  json["held_out"] = tuning.options.held_out > 0 ? score_json(candidate.held_out) : Json();
  return json;
}

}  // namespace

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
  } else if (tuning.options.judge == Judge::Bounds && !tuned.present.score.slack) {
    text += "nothing to compare: no task has a bound for all of its jobs, whatever was tried; see 'redag analyze'\n";
  } else {
    text += fmt::format("nothing to change: no other setting that was tried {}\n",
                        tuning.options.judge == Judge::Bounds ? "has better bounds" : "misses fewer deadlines");
  }
  if (!tuned.exhaustive) text += "found by local search, not all combinations were tried\n";
  if (tuned.stopped) text += fmt::format("stopped after {} settings\n", format_count(tuned.trials.size()));
  return text;
}

std::string describe(const Tuning &tuning, const StreamTraits &terminal, bool all) {
  const Workload &workload = tuning.tuned.present.workload;
  const lab::TuneOptions &options = tuning.options;
  std::string text = fmt::format("{}: {}, {}\n", workload.name, to_string(workload.policy),
                                 plural(workload.platform.workers, "worker"));
  if (options.judge == Judge::Bounds) {
    text += "judged by the bounds, which hold for every execution\n\n";
  } else {
    text += fmt::format("simulated {} with {}; validated on {}; settings that the bounds prove come first\n\n",
                        humanize_duration(options.simulation.duration),
                        options.seeds == 1 ? std::string("one seed") : fmt::format("each of {} seeds", options.seeds),
                        plural(options.held_out, "unseen seed"));
  }
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
    Json row = setting_json(tuning, point);
    row.update(score_json(score));
    trials.push_back(std::move(row));
  }
  return Json{{"format", "redag.tuning/4"},
              {"workload", tuned.present.workload.name},
              {"judge", to_string(options.judge)},
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
              {"present", candidate_json(tuned.present, tuning)},
              {"found", candidate_json(tuned.found, tuning)},
              {"best", candidate_json(tuned.best, tuning)},
              {"trials", trials}};
}

}  // namespace redag::cli
