// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_explanation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "redag/base/text.hpp"
#include "redag/loader/workload_yaml_edit.hpp"
#include "redag_analysis/text/rounded_time.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/terminal/options.hpp"
#include "redag_lab/search/obstacle.hpp"

namespace redag::cli {
namespace {

using analysis::Term;

// Names the owner of a term. A unit of several tasks has its DAG's name.
std::string owner(const lab::Analysed &analysed, const Term &term) {
  if (term.task.valid()) return task_name(analysed, term.task);
  if (term.dag.valid()) return analysed.task_set.dags[term.dag.value].name;
  switch (term.kind) {
    case Term::Kind::Blocking: return "less urgent work";
    case Term::Kind::Interference: return "more urgent work";
    default: return "-";
  }
}

std::string what(const lab::Analysed &analysed, const Term &term) {
  const std::string at = term.device.valid() ? " at " + device_name(analysed, term.device) : "";
  switch (term.kind) {
    // Of a DAG on several workers: its longest path (one job), and the delay of this path by the DAG's other tasks.
    case Term::Kind::Own: return term.jobs == 0 ? "its other tasks, off the longest path" : "own execution";
    case Term::Kind::Earlier: return term.amount < 0 ? "time since earlier jobs were released" : "its own earlier jobs";
    case Term::Kind::Blocking: return "blocking" + at + " by";
    case Term::Kind::Interference: return "interference" + at + " by";
    case Term::Kind::Jitter: return "release jitter";
    case Term::Kind::Wait: return "waiting for data of other rates";
    case Term::Kind::Suspended: return term.device.valid() ? "service" + at : "waits without a device";
    case Term::Kind::Overhead: return "overhead";
  }
  return "?";
}

std::string advice_on_blocking(const lab::Analysed &analysed, const std::string &who) {
  switch (analysed.task_set.mode) {
    case sched::Preemption::None:
      return fmt::format(
          "{} keeps its worker until it ends: shorten it, or let it be preempted (--preemption os, or `region` with "
          "--preemption cooperative)",
          who);
    case sched::Preemption::Cooperative:
      return fmt::format("{} keeps its worker until its next preemption point: give it a shorter `region`", who);
    case sched::Preemption::Full: break;
  }
  return fmt::format("{} holds a group or shares a priority level: shorten it, or take it out of the group", who);
}

std::string advice_at_device(const lab::Analysed &analysed, const Term &term) {
  const std::string device = device_name(analysed, term.device);
  switch (term.kind) {
    case Term::Kind::Blocking:
      return analysed.task_set.devices[term.device.value].queue == Device::Queue::Fifo
                 ? fmt::format("{} serves in the order of requests: `queue: priority`, or shorter service, helps most",
                               device)
                 : fmt::format("{} ends a service that has begun: shorter ones of less urgent tasks help most", device);
    case Term::Kind::Interference:
      return fmt::format("{} is served first: shorten its service, or give {} one more slot", owner(analysed, term),
                         device);
    default: return fmt::format("a shorter service of its own at {} helps most", device);
  }
}

std::string advice(const lab::Analysed &analysed, const Term &term) {
  if (term.device.valid()) return advice_at_device(analysed, term);
  const std::string who = owner(analysed, term);
  switch (term.kind) {
    case Term::Kind::Own:
      return term.jobs == 0 ? "its own tasks wait for each other: smaller wcets or a larger max_active help most"
                            : "a smaller wcet of its own helps most";
    case Term::Kind::Earlier:
      return "its earlier jobs have not ended when it is released: a smaller wcet or a longer period helps most";
    case Term::Kind::Blocking: return advice_on_blocking(analysed, who);
    case Term::Kind::Interference: {
      const std::string times = term.jobs > 1 ? fmt::format(" is released {} times before it ends",
                                                            format_count(static_cast<std::uint64_t>(term.jobs)))
                                              : std::string(" runs first");
      return fmt::format("{}{}: shorten it, release it less often, or add a worker", who, times);
    }
    case Term::Kind::Jitter: return "less release jitter helps most";
    case Term::Kind::Wait: return "a shorter period or response time of its predecessors helps most";
    case Term::Kind::Suspended: return "a shorter wait helps most";
    case Term::Kind::Overhead: return "fewer and longer jobs, or smaller scheduling overheads, help most";
  }
  return {};
}

double share(Duration part, Duration whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

// The row of the task's DAG, if that may miss its end-to-end deadline.
std::optional<lab::Row> dag_that_may_miss(const lab::Analysed &analysed, const lab::Row &row) {
  if (!row.task.valid()) return std::nullopt;
  const auto &dags = analysed.task_set.dags;
  const auto dag = std::find_if(dags.begin(), dags.end(), [&](const analysis::CompiledDag &candidate) {
    return std::find(candidate.tasks.begin(), candidate.tasks.end(), row.task.value) != candidate.tasks.end();
  });
  if (dag == dags.end()) return std::nullopt;
  const lab::Row its_row = lab::dag_rows(analysed)[static_cast<std::size_t>(dag - dags.begin())];
  return its_row.standing == lab::Standing::MayMiss ? std::optional(its_row) : std::nullopt;
}

std::string explain_bound(const lab::Analysed &analysed, const lab::Row &row, const StreamTraits &terminal) {
  const Duration response = *row.tightest.response;
  std::vector<Term> terms = lab::terms_of(analysed, row);
  std::stable_sort(terms.begin(), terms.end(), [](const Term &a, const Term &b) { return a.amount > b.amount; });
  Table table({{"what", false, 9}, {"of", false, 8}, {"jobs", true, 2}, {"time", true, 7}, {"share", true, 5}});
  for (const Term &term : terms) {
    if (term.amount == 0) continue;
    const bool is_negative = term.amount < 0;
    table.add({{what(analysed, term)},
               {owner(analysed, term)},
               {term.jobs > 0 ? format_count(static_cast<std::uint64_t>(term.jobs)) : "-"},
               {is_negative ? "-" + humanize_duration(-term.amount) : humanize_duration(term.amount)},
               {is_negative ? "-" : format_percent(share(term.amount, response))}});
  }
  std::string text = fmt::format("contributions to the bound by {}:\n", row.tightest.method->name) +
                     table.render(terminal.width, terminal.colour);
  if (terms.empty()) return text;
  const std::string largest =
      fmt::format("the largest contribution is {} of {} ({})", humanize_duration(terms.front().amount),
                  humanize_duration(response), format_percent(share(terms.front().amount, response)));
  const std::optional<lab::Row> late_dag = dag_that_may_miss(analysed, row);
  if (row.standing == lab::Standing::MayLose)
    return text + largest + fmt::format("\njobs that do not end in time can be lost: {}\n", row.reason);
  if (row.standing != lab::Standing::MayMiss && !late_dag) return text + largest + "; nothing needs to change\n";
  const std::string deadline = row.standing == lab::Standing::MayMiss
                                   ? ""
                                   : fmt::format(" for the end-to-end deadline of {}, {}", late_dag->name,
                                                 humanize_duration(late_dag->deadline));
  text += fmt::format("what to change{}: {}: {}\n", deadline, largest, advice(analysed, terms.front()));
  if (row.slack.value_or(0) < 0)
    text += fmt::format("the bound exceeds the deadline by {}\n", humanize_duration(-*row.slack));
  return text;
}

// Names the key without which the row stands better, with its line, and what it then has.
std::string name_obstacle(const lab::Analysed &analysed, const lab::Row &row, const SourceText &source) {
  const std::optional<lab::Obstacle> found = lab::find_obstacle(analysed, row);
  if (!found) return {};
  const analysis::CompiledDag &dag = analysed.task_set.dags[found->dag.value];
  std::optional<std::size_t> number;
  if (found->task.valid()) number = found->task.value - dag.tasks.front();
  const int line = source.dags.empty() ? 0 : line_of(source.text, source.dags[found->dag.value], number, found->key);
  const std::string place = line > 0 ? fmt::format("{}:{}: ", source.file, line) : std::string{};
  const std::string response =
      found->response ? ", response time at most " + humanize_up(*found->response) : std::string{};
  return fmt::format("in the way: {}{} of {}; without it: {}{}\n", place, found->key,
                     found->task.valid() ? task_name(analysed, found->task) : dag.name, to_string(found->standing),
                     response);
}

// Returns the reason why there is no bound, the methods that gave up or do not apply, and the load.
std::string explain_absence(const lab::Analysed &analysed, const lab::Row &row) {
  std::string text = fmt::format("reason for the missing bound: {}\n", row.reason);
  if (analysed.task_set.is_beyond_all()) return text;
  text += describe_gave_up(analysed.report);
  const std::string reasons = methods_that_do_not_apply(analysed.report, false);
  if (!reasons.empty()) text += "methods that do not apply:\n" + reasons;
  std::vector<std::pair<double, std::string>> loads;
  for (const analysis::Unit &unit : analysed.task_set.units) {
    Duration executes = unit.volume;
    for (const std::uint32_t t : unit.tasks) executes -= analysed.task_set.tasks[t].waits;
    loads.emplace_back(share(executes, unit.period), unit.tasks.size() > 1
                                                         ? analysed.task_set.dags[unit.dag.value].name
                                                         : task_name(analysed, TaskId(unit.tasks.front())));
  }
  std::stable_sort(loads.begin(), loads.end(), [](const auto &a, const auto &b) { return a.first > b.first; });
  constexpr std::size_t kMost = 3;
  text += "largest shares of the utilization:";
  for (std::size_t i = 0; i < loads.size() && i < kMost; ++i) {
    text += fmt::format("{} {} {}", i == 0 ? "" : ",", loads[i].second, format_percent(loads[i].first));
  }
  return text + "\n";
}

}  // namespace

Result<lab::Row> find_row(const lab::Analysed &analysed, const std::string &name) {
  std::vector<std::string> names;
  for (const bool of_dags : {false, true}) {
    for (lab::Row &row : of_dags ? lab::dag_rows(analysed) : lab::task_rows(analysed)) {
      std::string slashed = row.name;
      if (const std::size_t dot = slashed.find('.'); dot != std::string::npos) slashed[dot] = '/';
      if (row.name == name || (!of_dags && slashed == name)) return std::move(row);
      names.push_back(row.name);
    }
  }
  // A likely mistake is the task's own name without its DAG's.
  for (const std::string &candidate : names) {
    const std::size_t at = candidate.size() > name.size() ? candidate.size() - name.size() - 1 : std::string::npos;
    if (at != std::string::npos && candidate.compare(at, std::string::npos, "." + name) == 0) {
      return make_error("there is no task or DAG " + in_quotes(name), "did you mean '" + candidate + "'?");
    }
  }
  return make_error("there is no task or DAG " + in_quotes(name), suggestion(name, names));
}

std::string explain(const lab::Analysed &analysed, const lab::Row &row, const StreamTraits &terminal,
                    const SourceText &source) {
  std::string text = tinted(row.name, Tint::Strong, terminal.colour) + ": ";
  if (row.tightest.response) {
    text += fmt::format("response time at most {}, ", humanize_up(*row.tightest.response));
  } else {
    text += "no bound on its response time, ";
  }
  text += row.deadline > 0 ? fmt::format("deadline {}: ", humanize_duration(row.deadline)) : "no end-to-end deadline: ";
  text += row.standing == lab::Standing::NoDeadline ? "no deadline to miss" : to_string(row.standing);
  if (row.standing == lab::Standing::Ok && row.says != nullptr) text += fmt::format(", shown by {}", row.says->name);
  text += "\n";
  if (row.due && row.deadline > *row.due) {
    text += fmt::format("judged at {}: after that, the next release would skip a job that has not started\n",
                        humanize_duration(*row.due));
  }
  text += row.tightest.response ? explain_bound(analysed, row, terminal) : explain_absence(analysed, row);
  if (row.standing != lab::Standing::Ok && row.standing != lab::Standing::NoDeadline) {
    text += name_obstacle(analysed, row, source);
  }
  const bool is_open = row.due && (row.standing == lab::Standing::MayMiss || row.standing == lab::Standing::MayLose ||
                                   row.standing == lab::Standing::NoBound);
  if (is_open && analysed.report.verdict != analysis::Verdict::Schedulable) {
    text += "suggested change: " +
            suggested_change(analysed, row).value_or("no single change was found that lets every deadline be shown") +
            "\n";
  }
  return text;
}

}  // namespace redag::cli
