// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/assignment_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/analyze/score_text.hpp"
#include "redag_lab/workload/changes.hpp"

namespace redag::cli {
namespace {

using lab::Assignment;
using lab::BoundScore;
using lab::Caps;
using lab::Extremes;
using lab::Objective;
using lab::OrderCandidate;

constexpr std::size_t kMostTrials = 10;

std::vector<Cell> score_cells(const BoundScore &score) {
  return {{score.schedulable ? "yes" : "not shown", score.schedulable ? Tint::Good : Tint::Caution},
          {score.unbounded == 0 ? "-" : fmt::format("{}", score.unbounded)},
          {lateness_text(score.extremes), score.extremes.worst_lateness > 0 ? Tint::Bad : Tint::Plain},
          {slack_text(score.extremes)}};
}

Table score_table(const char *title) {
  return Table({{title, false, 9},
                {"schedulable", false, 8},
                {"unbounded", true, 3},
                {"worst lateness", true, 7},
                {"least slack", true, 6},
                {.title = "max_active", .importance = 2, .prose = true}});
}

std::string orders_table(const Assignment &assignment, const StreamTraits &terminal) {
  Table table = score_table("order");
  for (const OrderCandidate &candidate : assignment.orders) {
    std::vector<Cell> cells = {{candidate.order}};
    for (Cell &cell : score_cells(candidate.score)) cells.push_back(std::move(cell));
    cells.push_back({caps_text(candidate.workload, candidate.caps), Tint::Faint});
    table.add(std::move(cells));
  }
  return table.render(terminal.width, terminal.colour);
}

using Ranked = std::vector<std::pair<Caps, BoundScore>>;

Ranked ranked(const Assigned &assigned) {
  Ranked trials(assigned.assignment.trials.begin(), assigned.assignment.trials.end());
  std::stable_sort(trials.begin(), trials.end(), [&](const auto &a, const auto &b) {
    return lab::is_better(a.second, b.second, assigned.options.objective);
  });
  return trials;
}

// Returns the combinations of max_active that were tried, best first.
std::string trials_table(const Assigned &assigned, const StreamTraits &terminal, bool all) {
  const Ranked trials = ranked(assigned);
  const Workload &workload = assigned.assignment.best.workload;
  const std::size_t shown = all ? trials.size() : std::min(trials.size(), kMostTrials);
  Table table({{.title = "max_active", .importance = 9, .prose = true},
               {"schedulable", false, 8},
               {"unbounded", true, 3},
               {"worst lateness", true, 7},
               {"least slack", true, 6}});
  const auto add = [&](const Ranked::value_type &trial) {
    const auto &[caps, score] = trial;
    std::vector<Cell> cells = {{caps_text(workload, caps)}};
    for (Cell &cell : score_cells(score)) cells.push_back(std::move(cell));
    table.add(std::move(cells));
  };
  for (std::size_t i = 0; i < shown; ++i) add(trials[i]);
  if (shown < trials.size()) add(trials.back());
  std::string text = table.render(terminal.width, terminal.colour);
  if (shown < trials.size()) {
    text += fmt::format("(the best {} of {} combinations under this order, and the worst;\n--all-tasks shows all)\n",
                        shown, format_count(trials.size()));
  }
  return text;
}

std::string audsley_words(const Assignment &assignment) {
  if (assignment.audsley_test.empty()) {
    return assignment.audsley_reason.empty()
               ? ""
               : "Audsley's assignment was not tried: " + assignment.audsley_reason + "\n";
  }
  std::string text = "Audsley's assignment, by " + assignment.audsley_test + ": ";
  text += assignment.audsley_found ? "finds an order that passes" : "finds no order that passes";
  if (!assignment.audsley_optimal) return text + "; the search is a heuristic here, and another order may pass\n";
  return text + (assignment.audsley_found ? "\n" : "; no order passes this test\n");
}

Json score_json(const BoundScore &score) {
  const Extremes &extremes = score.extremes;
  return Json{{"schedulable", score.schedulable},
              {"unbounded", score.unbounded},
              {"worst_lateness_ns", extremes.any ? Json(extremes.worst_lateness) : Json()},
              {"least_slack", extremes.any ? Json(extremes.least_slack) : Json()}};
}

Json caps_json(const Workload &workload, const Caps &caps) {
  Json list = Json::object();
  for (std::size_t d = 0; d < caps.size(); ++d) list[workload.dags[d].name] = caps[d];
  return list;
}

Json candidate_json(const OrderCandidate &candidate) {
  Json json = {{"order", candidate.order}, {"policy", to_string(candidate.workload.policy)}};
  json.update(score_json(candidate.score));
  json["max_active"] = caps_json(candidate.workload, candidate.caps);
  json["priorities"] = Json::object();
  for (const TaskRef &ref : flatten(candidate.workload)) {
    const std::string name = candidate.workload.dags[ref.dag.value].name + "." + ref.task->name;
    json["priorities"][name] = ref.task->priority ? Json(*ref.task->priority) : Json();
  }
  return json;
}

}  // namespace

std::vector<std::string> changes(const Assignment &assignment) {
  std::vector<std::string> list;
  for (const lab::Change &change : lab::changes_between(assignment.present.workload, assignment.best.workload)) {
    list.push_back(change.text());
  }
  return list;
}

std::string in_words(const Assigned &assigned) {
  const Assignment &assignment = assigned.assignment;
  const BoundScore &before = assignment.present.score;
  const BoundScore &after = assignment.best.score;
  std::string text;
  const bool is_unchanged = assignment.best.workload == assignment.present.workload;
  if (is_unchanged && !after.schedulable && !after.extremes.any) {
    text += "nothing to compare: no method bounds any response time, whatever was tried; see 'redag analyze'\n";
  } else if (is_unchanged) {
    text += fmt::format(
        "nothing to change: no other assignment that was tried has {}\n",
        assigned.options.objective == Objective::Lateness ? "a smaller worst lateness" : "a larger least slack");
  } else {
    if (!before.schedulable && after.schedulable) {
      text += "gain: the workload becomes schedulable by the bounds\n";
    }
    if (before.unbounded != after.unbounded) {
      text += fmt::format("gain: deadlines without a bound: {} -> {}\n", before.unbounded, after.unbounded);
    }
    text += fmt::format("worst lateness (bound - deadline): {} -> {}\n", lateness_text(before.extremes),
                        lateness_text(after.extremes));
    text += fmt::format("least slack (share of a deadline): {} -> {}\n", slack_text(before.extremes),
                        slack_text(after.extremes));
  }
  if (!after.schedulable) text += "no assignment that was tried is shown schedulable\n";
  text += audsley_words(assignment);
  if (!assignment.exhaustive) {
    text += fmt::format("max_active: found by local search (seed {}), not all combinations were tried\n",
                        assigned.options.seed);
  }
  if (assignment.stopped) text += fmt::format("stopped after {} analyses\n", format_count(assignment.analyses));
  return text;
}

std::string describe(const Assigned &assigned, const StreamTraits &terminal, bool all) {
  const Assignment &assignment = assigned.assignment;
  const Workload &workload = assignment.present.workload;
  std::string text = fmt::format("{}: {}, {} worker{}; objective: {}\n\n", workload.name, to_string(workload.policy),
                                 assigned.platform.workers, assigned.platform.workers == 1 ? "" : "s",
                                 to_string(assigned.options.objective));
  text += orders_table(assignment, terminal);
  const BoundScore &best = assignment.best.score;
  if (assignment.trials.size() > 1 && (best.schedulable || best.extremes.any)) {
    text += fmt::format("\nmax_active under {}, {}\n", assignment.best.order,
                        assignment.exhaustive ? "every combination" : "combinations that the local search tried");
    text += trials_table(assigned, terminal, all);
  }
  text += fmt::format(
      "\nworst lateness and least slack are those of the bounds, which hold for every execution; {} analyses\n"
      "\n",
      format_count(assignment.analyses));
  for (const std::string &change : changes(assignment)) {
    text += tinted("change ", Tint::Strong, terminal.colour) + change + "\n";
  }
  return text + in_words(assigned);
}

Json to_json(const Assigned &assigned) {
  const Assignment &assignment = assigned.assignment;
  Json document = {{"format", "redag.assignment/1"},         {"workload", assignment.present.workload.name},
                   {"workers", assigned.platform.workers},   {"objective", to_string(assigned.options.objective)},
                   {"seed", assigned.options.seed},          {"schedulable", assignment.best.score.schedulable},
                   {"changes", changes(assignment)},         {"text", in_words(assigned)},
                   {"exhaustive", assignment.exhaustive},    {"stopped", assignment.stopped},
                   {"analyses", assignment.analyses},        {"present", candidate_json(assignment.present)},
                   {"best", candidate_json(assignment.best)}};
  document["orders"] = Json::array();
  for (const OrderCandidate &candidate : assignment.orders) document["orders"].push_back(candidate_json(candidate));
  document["trials"] = Json::array();
  for (const auto &[caps, score] : assignment.trials) {
    Json row = {{"max_active", caps_json(assignment.best.workload, caps)}};
    row.update(score_json(score));
    document["trials"].push_back(std::move(row));
  }
  document["audsley"] = {{"test", assignment.audsley_test},
                         {"optimal", assignment.audsley_optimal},
                         {"found", assignment.audsley_found},
                         {"reason", assignment.audsley_reason}};
  return document;
}

}  // namespace redag::cli
