// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/analysis_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "redag/base/text.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/text/rounded_time.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/search/remedy.hpp"

namespace redag::cli {
namespace {

using analysis::Method;
using analysis::MethodReport;
using analysis::NotApplicable;

constexpr std::size_t kMostTasks = 50;  // with more tasks, the table shows only this many, the tightest

Tint tint_of(lab::Standing standing) {
  switch (standing) {
    case lab::Standing::Ok: return Tint::Good;
    case lab::Standing::MayMiss: return Tint::Bad;
    case lab::Standing::MayLose:
    case lab::Standing::NoBound: return Tint::Caution;
    case lab::Standing::NoDeadline: return Tint::Faint;
  }
  return Tint::Plain;
}

std::string table_of(const char *title, const std::vector<lab::Row> &rows, const StreamTraits &terminal) {
  Table table({{title, false, 9},
               {"deadline", true, 4},
               {"bound", true, 7},
               {"slack", true, 5},
               {"verdict", false, 8},
               {"method", false, 3}});
  for (const lab::Row &row : rows) {
    const Tint tint = tint_of(row.standing);
    table.add({{row.name},
               {row.deadline > 0 ? humanize_duration(row.deadline) : "-"},
               {row.tightest.response ? humanize_up(*row.tightest.response) : "-"},
               {row.slack ? humanize_down(*row.slack) : "-", row.slack.value_or(0) < 0 ? Tint::Bad : Tint::Plain},
               {to_string(row.standing), tint},
               {row.says != nullptr ? std::string(row.says->name) : "-", Tint::Faint}});
  }
  return table.render(terminal.width, terminal.colour);
}

// Returns all rows in the workload's order, or only those nearest to a miss.
std::vector<lab::Row> shown_rows(std::vector<lab::Row> rows, bool all) {
  if (all || rows.size() <= kMostTasks) return rows;
  const auto urgency = [](const lab::Row &row) {
    if (row.standing == lab::Standing::NoBound) return -kMaxDuration;
    return row.slack.value_or(kMaxDuration);
  };
  std::stable_sort(rows.begin(), rows.end(),
                   [&](const lab::Row &a, const lab::Row &b) { return urgency(a) < urgency(b); });
  rows.resize(kMostTasks);
  return rows;
}

// Formats a share rounded down: "2.0 %".
std::string format_share(Duration part, Duration whole) {
  return fmt::format("{:.1f} %", std::floor(1000 * static_cast<double>(part) / static_cast<double>(whole)) / 10);
}

// Summarises a method's answer in a few words.
Cell answer(const MethodReport &report) {
  if (!report.trusted) return {"not sound here", Tint::Caution};
  if (report.verdict == analysis::Verdict::Schedulable) return {"schedulable", Tint::Good};
  return {"not shown", Tint::Caution};
}

std::string remark(const lab::Analysed &analysed, const MethodReport &report) {
  const analysis::Bound *bound = report.bound();
  std::string text;
  if (!bound->tasks.empty()) {
    const auto has_response = [](const analysis::ResponseBound &task) { return task.response.has_value(); };
    const auto bounded = std::count_if(bound->tasks.begin(), bound->tasks.end(), has_response);
    text = fmt::format("bounds {} of {} tasks", bounded, analysed.task_set.tasks.size());
  }
  if (!bound->figures.empty()) text += (text.empty() ? "" : "; ") + bound->figures;
  if (!bound->unsound.empty()) text += (text.empty() ? "" : "; ") + bound->unsound;
  return text;
}

std::string method_table(const lab::Analysed &analysed, const StreamTraits &terminal) {
  if (analysed.task_set.is_beyond_all()) {
    return fmt::format("no method applies to all tasks: {}\n", analysed.task_set.not_analysable);
  }
  std::vector<const MethodReport *> order;  // trusted methods first
  for (const bool trusted : {true, false}) {
    for (const MethodReport &report : analysed.report.methods) {
      if (report.bound() != nullptr && report.trusted == trusted) order.push_back(&report);
    }
  }
  Table table({{"method", false, 9}, {"answer", false, 8}, {.title = "why", .importance = 1, .prose = true}});
  for (const MethodReport *report : order) {
    const std::string paper = report->method->is_paper() ? "paper: " : "";
    table.add({{std::string(report->method->name)}, answer(*report), {paper + remark(analysed, *report), Tint::Faint}});
  }
  const std::string others = methods_that_do_not_apply(analysed.report, true);
  return (order.empty() ? "" : table.render(terminal.width, terminal.colour)) +
         (others.empty() ? "" : "methods that do not apply:\n" + others);
}

std::string headline(const lab::Analysed &analysed) {
  const analysis::AnalysisPlatform &platform = analysed.task_set.platform;
  const std::string reason = mode_reason(analysed);
  // The jobs are ordered by the policy, or by another executor, which ignores policies.
  const std::string order =
      analysed.executor->ours ? to_string(analysed.workload.policy) : std::string(analysed.executor->description);
  std::string text = fmt::format("{}: {}, {}, utilization {:.3f}\n", analysed.workload.name, order,
                                 plural(platform.workers, "worker"), analysed.task_set.utilization);
  text += fmt::format("preemption: {}{}\n", mode_name(analysed), reason.empty() ? "" : " (" + reason + ")");
  if (platform.levels > 0) text += fmt::format("priority levels: {}\n", platform.levels);
  if (platform.release_overhead > 0 || platform.dispatch_overhead > 0 || platform.preempt_overhead > 0) {
    text += fmt::format("overheads: release {}, dispatch {}, preempt {}\n", format_duration(platform.release_overhead),
                        format_duration(platform.dispatch_overhead), format_duration(platform.preempt_overhead));
  }
  if (platform.lateness > 0 || platform.timer_overhead > 0 || platform.stall != Loss{}) {
    text += fmt::format(
        "machine: releases are up to {} late and cost {} of processor time each; a processor stalls for up to {} + {} "
        "a second\n",
        humanize_duration(platform.lateness), humanize_duration(platform.timer_overhead),
        humanize_duration(platform.stall.longest), humanize_duration(platform.stall.per_second));
  }
  return text;
}

// Returns "a and b" or "a, b and 2 more".
std::string listed(const std::vector<const Method *> &methods) {
  constexpr std::size_t kMost = 3;
  std::string text;
  for (std::size_t i = 0; i < methods.size() && i < kMost; ++i) {
    const bool last = i + 1 == methods.size();
    text += fmt::format("{}{}", i == 0 ? "" : last ? " and " : ", ", methods[i]->name);
  }
  if (methods.size() > kMost) text += fmt::format(" and {} more", methods.size() - kMost);
  return text;
}

}  // namespace

const char *to_string(lab::Standing standing) {
  switch (standing) {
    case lab::Standing::Ok: return "ok";
    case lab::Standing::MayMiss: return "MAY MISS";
    case lab::Standing::MayLose: return "may lose jobs";
    case lab::Standing::NoBound: return "no bound";
    case lab::Standing::NoDeadline: return "-";
  }
  return "?";
}

const char *mode_name(const lab::Analysed &analysed) {
  return trace::preemption_name(analysed.task_set.platform.preemption);
}

std::string mode_reason(const lab::Analysed &analysed) {
  const analysis::TaskSet &task_set = analysed.task_set;
  if (task_set.platform.preemption == sched::Preemption::Cooperative && task_set.mode == sched::Preemption::None) {
    return "no task has a region, so this equals none";
  }
  if (!analysed.executor->ours) return "rclcpp's executors do not preempt";
  if (analysed.workload.platform.preemption != PreemptionMode::Auto) return {};
  return is_static(task_set.policy)
             ? "auto is analysed as os; a process without SCHED_FIFO runs it as cooperative, see --preemption"
             : fmt::format("auto is analysed and simulated as os; threads run {} as cooperative, see --preemption",
                           to_string(task_set.policy));
}

std::string verdict_in_words(const lab::Analysed &analysed) {
  const analysis::Report &report = analysed.report;
  if (report.verdict == analysis::Verdict::Schedulable) {
    return fmt::format("schedulable: every deadline is met, by {}", listed(report.by));
  }
  const double needed = analysed.workload.utilization();
  const std::uint32_t workers = analysed.task_set.platform.workers;
  if (needed > workers * (1 + 1e-9)) {
    return fmt::format("not schedulable: the utilization, {:.3f}, exceeds the capacity of {}", needed,
                       plural(workers, "worker"));
  }
  const auto has_bound = [](const analysis::Tightest &task) { return task.response.has_value(); };
  if (analysed.task_set.is_beyond_all() && std::none_of(report.tasks.begin(), report.tasks.end(), has_bound)) {
    return "not shown schedulable: no method applies to this workload: " + analysed.task_set.not_analysable;
  }
  std::size_t late = 0;
  std::size_t unbounded = 0;
  std::size_t losing = 0;
  const auto count = [&](const std::vector<lab::Row> &rows) {
    for (const lab::Row &row : rows) {
      if (row.standing == lab::Standing::MayMiss) ++late;
      if (row.standing == lab::Standing::MayLose) ++losing;
      if (row.standing == lab::Standing::NoBound && row.due) ++unbounded;
    }
  };
  count(lab::task_rows(analysed));
  const std::size_t late_tasks = late;
  const std::size_t unbounded_tasks = unbounded;
  count(lab::dag_rows(analysed));
  std::string missing;
  const auto say = [&](std::size_t number, const char *noun, const char *what) {
    if (number > 0) missing += fmt::format("{}{} {}", missing.empty() ? "" : ", ", plural(number, noun), what);
  };
  say(late_tasks, "task", "with a bound above the deadline");
  say(losing, "task", "whose jobs can be lost");
  say(unbounded_tasks, "task", "without a bound");
  say(late - late_tasks, "DAG", "with a bound above the end-to-end deadline");
  say(unbounded - unbounded_tasks, "DAG", "with an end-to-end deadline and without a bound");
  return fmt::format("not shown schedulable: {}; bounds are safe, not exact; --explain shows what a bound consists of",
                     missing);
}

std::string describe(const lab::Analysed &analysed, const StreamTraits &terminal, bool all) {
  const std::vector<lab::Row> tasks = lab::task_rows(analysed);
  std::string text = headline(analysed) + "\n" + table_of("task", shown_rows(tasks, all), terminal);
  if (!all && tasks.size() > kMostTasks) {
    text += fmt::format("(the {} of {} tasks with the least slack; --all-tasks shows all)\n", kMostTasks,
                        format_count(tasks.size()));
  }
  text += "\n" + table_of("DAG", lab::dag_rows(analysed), terminal) + "\n";
  text +=
      "bound: response time from the nominal release that no job exceeds; for a DAG, and for its tasks where edges "
      "join them, from the source's release; verdicts hold for every execution\n";
  for (const lab::Row &row : tasks) {
    if (*row.due == row.deadline) continue;
    text +=
        "slack: time to the deadline, or to the instant at which the next release would skip a job that has not "
        "started, whichever is sooner\n";
    break;
  }
  const bool yes = analysed.report.verdict == analysis::Verdict::Schedulable;
  const std::string words = verdict_in_words(analysed);
  const std::size_t colon = words.find(':');
  text += "\n" + tinted(words.substr(0, colon), yes ? Tint::Good : Tint::Bad, terminal.colour) + words.substr(colon);
  text += "\n\n" + describe_gave_up(analysed.report) + method_table(analysed, terminal);
  return text;
}

std::optional<std::string> suggested_change(const lab::Analysed &analysed, const lab::Row &row) {
  if (!analysed.executor->ours) return std::nullopt;
  if (analysed.task_set.tasks.size() > lab::kMostTasksForRemedy) return std::nullopt;
  auto remedy = lab::find_remedy(analysed.workload, analysed.task_set.platform, lab::suspects_of(analysed, row));
  if (!remedy) return std::nullopt;
  return *remedy + "; then every deadline is shown to be met";
}

std::string summarise(const lab::Analysed &analysed, const StreamTraits &terminal) {
  const bool yes = analysed.report.verdict == analysis::Verdict::Schedulable;
  const std::string words = verdict_in_words(analysed);
  const std::size_t colon = words.find(':');
  const std::string reason = mode_reason(analysed);
  std::string text =
      fmt::format("{}: {}{}\n", analysed.workload.name.empty() ? std::string("workload") : analysed.workload.name,
                  tinted(words.substr(0, colon), yes ? Tint::Good : Tint::Bad, terminal.colour), words.substr(colon));
  const std::optional<lab::Row> weakest = lab::weakest_row(analysed);
  if (weakest) {
    const bool is_task = weakest->name.find('.') != std::string::npos;
    text += fmt::format("weakest: {}{}, deadline {}, ", is_task ? "" : "DAG ", weakest->name,
                        humanize_duration(*weakest->due));
    text += weakest->slack ? fmt::format("bound {}, slack {} ({}), by {}", humanize_up(*weakest->tightest.response),
                                         humanize_down(*weakest->slack), format_share(*weakest->slack, *weakest->due),
                                         weakest->says->name)
                           : (weakest->tightest.response ? "jobs can be lost: " : "no bound: ") + weakest->reason;
    text += "\n";
    if (!yes) {
      text += "suggested change: " +
              suggested_change(analysed, *weakest)
                  .value_or(fmt::format("no single change was found; see --explain {}", weakest->name)) +
              "\n";
    }
  }
  text += describe_gave_up(analysed.report);
  text += fmt::format("preemption: {}{}\n", mode_name(analysed), reason.empty() ? "" : " (" + reason + ")");
  text += fmt::format("--all shows every task and method{}\n",
                      weakest ? "; --explain " + weakest->name + " explains its bound" : "");
  return text;
}

std::string methods_that_do_not_apply(const analysis::Report &report, bool tests) {
  std::vector<std::pair<std::string, std::string>> reasons;  // each with the methods that state it
  for (const MethodReport &method : report.methods) {
    const auto *reason = std::get_if<NotApplicable>(&method.outcome);
    if (reason == nullptr || reason->gave_up || (!tests && method.method->subject == analysis::Subject::TaskSet))
      continue;
    const auto same =
        std::find_if(reasons.begin(), reasons.end(), [&](const auto &known) { return known.first == reason->reason; });
    if (same == reasons.end()) {
      reasons.emplace_back(reason->reason, std::string(method.method->name));
    } else {
      same->second += ", " + std::string(method.method->name);
    }
  }
  std::string text;
  for (const auto &[reason, methods] : reasons) text += fmt::format("  {}\n    {}\n", reason, methods);
  return text;
}

std::string describe_gave_up(const analysis::Report &report) {
  std::string text;
  for (const MethodReport &method : report.methods) {
    if (!method.gave_up()) continue;
    text += fmt::format("gave up on {}: {}\n", method.method->name, std::get<NotApplicable>(method.outcome).reason);
  }
  if (!text.empty()) text += "  --effort and --time-limit set these limits; the results of other methods hold\n";
  return text;
}

std::string describe_methods() {
  std::string text;
  const auto describe = [&text](const Method &method, std::string_view remark) {
    text += fmt::format("{} ({}{})\n  assumes: {}\n  cite: {}\n  complexity: {}\n", method.name,
                        to_string(method.subject), remark, method.assumptions, method.cite, method.complexity);
    if (method.is_paper()) text += fmt::format("  sound only if: {}\n", method.sound_only_if);
  };
  for (const Method &method : analysis::methods()) describe(method, method.is_paper() ? ", paper" : "");
  text +=
      "\n"
      "Methods for rclcpp's own executors, with --executor ste or mte:\n";
  for (const Method &method : analysis::executor_methods()) describe(method, "");
  return text;
}

}  // namespace redag::cli
