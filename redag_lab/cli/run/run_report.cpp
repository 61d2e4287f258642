// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/run/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <numeric>
#include <utility>

#include "redag/base/text.hpp"
#include "redag_analysis/metrics/files/summary_json.hpp"
#include "redag_analysis/metrics/verdict.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"
#include "redag_lab/cli/run/bound_report.hpp"

namespace redag::cli {
namespace {

constexpr std::size_t kMostTaskRows = 50;  // with more tasks, the table shows only this many, the worst

// Formats a duration, or "-" if there is none.
Cell spread_cell(const metrics::Distribution &distribution, Duration metrics::Distribution::*value) {
  return {distribution.count > 0 ? humanize_duration(distribution.*value) : "-"};
}

Cell jobs_cell(std::uint64_t count, Tint tint = Tint::Plain) {
  return {format_count(count), count > 0 ? tint : Tint::Faint};
}

Cell missed_jobs_cell(const metrics::JobCounts &jobs) {
  return {format_count_and_share(jobs.missed(), jobs.released), jobs.missed() > 0 ? Tint::Bad : Tint::Good};
}

// Returns the tasks to show: all in the workload's order, or the worst ones.
std::vector<std::size_t> shown_tasks(const metrics::Summary &summary, bool all) {
  std::vector<std::size_t> order(summary.tasks.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (all || order.size() <= kMostTaskRows) return order;
  const auto worse = [&](std::size_t a, std::size_t b) {
    const metrics::JobStats &x = summary.tasks[a].jobs;
    const metrics::JobStats &y = summary.tasks[b].jobs;
    if (x.miss_ratio_with_lost() != y.miss_ratio_with_lost())
      return x.miss_ratio_with_lost() > y.miss_ratio_with_lost();
    return x.max_lateness.value_or(-kMaxDuration) > y.max_lateness.value_or(-kMaxDuration);
  };
  std::partial_sort(order.begin(), order.begin() + kMostTaskRows, order.end(), worse);
  order.resize(kMostTaskRows);
  return order;
}

std::string task_table(const lab::Session &session, const StreamTraits &terminal, bool all) {
  Table table({{"task", false, 9},
               {"jobs", true, 7},
               {"late", true, 1},
               {"skipped", true, 1},
               {"aborted", true, 0},
               {"missed", true, 8},
               {"p50", true, 3},
               {"p95", true, 2},
               {"p99", true, 4},
               {"max", true, 7},
               {"deadline", true, 3}});
  const std::vector<TaskRef> refs = flatten(session.info.workload);
  for (const std::size_t i : shown_tasks(session.summary, all)) {
    const metrics::TaskSummary &task = session.summary.tasks[i];
    const metrics::JobStats &jobs = task.jobs;
    const bool late = jobs.max_lateness.value_or(0) > 0;
    table.add({{task.dag + "." + task.name},
               jobs_cell(jobs.released),
               jobs_cell(jobs.late, Tint::Bad),
               jobs_cell(jobs.skipped, Tint::Bad),
               jobs_cell(jobs.aborted, Tint::Bad),
               missed_jobs_cell(jobs),
               spread_cell(jobs.response, &metrics::Distribution::p50),
               spread_cell(jobs.response, &metrics::Distribution::p95),
               spread_cell(jobs.response, &metrics::Distribution::p99),
               {spread_cell(jobs.response, &metrics::Distribution::max).text, late ? Tint::Bad : Tint::Plain},
               {humanize_duration(refs[i].task->deadline)}});
  }
  std::string text = table.render(terminal.width, terminal.colour);
  if (!all && session.summary.tasks.size() > kMostTaskRows) {
    text += fmt::format("(the worst {} of {} tasks; --all-tasks shows all)\n", kMostTaskRows,
                        format_count(session.summary.tasks.size()));
  }
  return text;
}

std::string dag_table(const lab::Session &session, const StreamTraits &terminal) {
  const Workload &workload = session.info.workload;
  const bool has_clusters = !workload.platform.clusters.empty();
  std::vector<Column> columns = {{"DAG", false, 9},           {"jobs", true, 7},  {"missed", true, 8},
                                 {"end-to-end p50", true, 3}, {"p99", true, 4},   {"max", true, 6},
                                 {"deadline", true, 2},       {"active", true, 1}};
  if (has_clusters) columns.push_back({"cluster", false, 5});
  Table table(std::move(columns));
  for (std::size_t d = 0; d < session.summary.dags.size(); ++d) {
    const metrics::DagSummary &dag = session.summary.dags[d];
    const metrics::Distribution &end_to_end = dag.end_to_end.response;
    const std::string bound = dag.max_active > 0 ? fmt::format("{}", dag.max_active) : "-";
    std::vector<Cell> row = {
        {dag.name},
        jobs_cell(dag.jobs.released),
        missed_jobs_cell(dag.jobs),
        spread_cell(end_to_end, &metrics::Distribution::p50),
        spread_cell(end_to_end, &metrics::Distribution::p99),
        {spread_cell(end_to_end, &metrics::Distribution::max).text, dag.end_to_end.late > 0 ? Tint::Bad : Tint::Plain},
        {dag.end_to_end.deadline > 0 ? humanize_duration(dag.end_to_end.deadline) : "-"},
        {fmt::format("{}/{}", dag.peak_active, bound)}};
    if (has_clusters) row.push_back({workload.dags[d].cluster});
    table.add(std::move(row));
  }
  return table.render(terminal.width, terminal.colour);
}

std::string legend(const lab::Session &session) {
  std::string text =
      "missed: late, skipped or aborted\n"
      "times of tasks: finish - release\n"
      "times of DAGs: end to end, from the release of a source to the finish of a sink";
  const auto &dags = session.summary.dags;
  const bool several =
      std::any_of(dags.begin(), dags.end(), [](const auto &dag) { return dag.end_to_end.sinks.size() > 1; });
  return text + (several ? "; with several sinks, each figure is that of the worst one\n" : "\n");
}

std::string verdict_line(const lab::Session &session, const StreamTraits &terminal) {
  const metrics::DeadlineVerdict verdict = metrics::deadline_verdict(session.summary.total, session.summary.dags);
  const Tint tint = !verdict.is_judged ? Tint::Caution : verdict.is_met ? Tint::Good : Tint::Bad;
  return tinted(verdict.text, tint, terminal.colour) + "\n";
}

// Simulations are not compared with bounds here; the property tests do so.
bool has_bounds(const lab::Session &session) { return session.info.driver == trace::Driver::Threads; }

std::string headline(const lab::Session &session) {
  const trace::RunInfo &info = session.info;
  const bool simulated = info.driver == trace::Driver::Simulator;
  const std::string length = humanize_duration(info.end - info.start);
  std::string text = fmt::format("{}: {}, {}, {}, {}, seed {}\n", info.workload.name, info.executor,
                                 to_string(info.config.policy), plural(info.config.workers, "worker"),
                                 simulated ? "simulation of " + length : "run of " + length + " on threads", info.seed);
  text += fmt::format("preemption: {}{}\n", info.preemption,
                      info.preemption_why.empty() ? "" : " (" + info.preemption_why + ")");
  if (!info.overheads.empty()) text += fmt::format("overheads: {}\n", info.overheads);
  if (info.warm_up > 0) text += fmt::format("warm-up: the first {} are not counted\n", humanize_duration(info.warm_up));
  if (session.stopped) text += "stopped early: the results cover only the time until then\n";
  return text;
}

}  // namespace

std::string describe_check(const metrics::CheckReport &check, const StreamTraits &terminal) {
  const std::uint64_t checks =
      std::accumulate(check.checks_by_rule.begin(), check.checks_by_rule.end(), std::uint64_t{0});
  const auto rules = std::count_if(check.checks_by_rule.begin(), check.checks_by_rule.end(),
                                   [](std::uint64_t count) { return count > 0; });
  std::string tested = fmt::format("{} checks of {} rules", format_count(checks), rules);
  if (check.not_judged > 0) {
    tested += fmt::format("; {} not made, because the rates of tasks changed later", format_count(check.not_judged));
  }
  if (check.ok()) return fmt::format("trace check: {}, {}\n", tinted("ok", Tint::Good, terminal.colour), tested);
  return fmt::format("trace check: {}, {}\n{}",
                     tinted(plural(check.violation_count, "violation"), Tint::Bad, terminal.colour), tested,
                     check.to_string());
}

std::string describe(const lab::Session &session, const StreamTraits &terminal, const ReportOptions &options) {
  std::string text = headline(session) + "\n";
  text += task_table(session, terminal, options.all_tasks) + "\n" + dag_table(session, terminal) + "\n";
  text += legend(session) + verdict_line(session, terminal);
  double error = 0;
  for (const metrics::TaskSummary &task : session.summary.tasks) {
    error = std::max(error, task.jobs.response.percentile_error);
  }
  if (error > 0) text += fmt::format("percentiles of tasks with many jobs are accurate to {:.1f} %\n", 100 * error);
  if (!session.summary.worker_busy.empty()) {
    text += "workers busy:";
    for (const double share : session.summary.worker_busy) text += fmt::format(" {}", format_percent(share));
    text += "\n";
  }
  const metrics::Inversions &inversions = session.summary.inversions;
  text +=
      fmt::format("priority inversions: {}{}\n", format_count(inversions.count),
                  inversions.count > 0 ? fmt::format(", longest {}, in total {}", humanize_duration(inversions.longest),
                                                     humanize_duration(inversions.total))
                                       : "");
  if (has_bounds(session)) text += describe(lab::check_bounds(session), session.summary.tasks.size(), terminal);
  if (session.summary.total.exceeded > 0) {
    text +=
        fmt::format("jobs that used up their budget and continued: {}\n", format_count(session.summary.total.exceeded));
  }
  const metrics::HighModeTime &high = session.summary.high_mode;
  if (high.count > 0) {
    text += fmt::format("HI mode: {}, in total {}\n", plural(high.count, "time"), humanize_duration(high.total));
  }
  text += describe_check(session.check, terminal);
  if (session.cut_at) {
    text += fmt::format("events checked and kept: the first {}, {} of {}; --max-events raises this limit\n",
                        format_count(session.checked), humanize_duration(*session.cut_at),
                        humanize_duration(session.info.end));
  }
  return text;
}

Json to_json(const metrics::CheckReport &check) {
  Json rules = Json::object();
  for (std::size_t i = 0; i < metrics::kRuleCount; ++i) {
    if (check.checks_by_rule[i] == 0) continue;
    rules[to_string(static_cast<metrics::Rule>(i))] = {{"checks", check.checks_by_rule[i]},
                                                       {"violations", check.violations_by_rule[i]}};
  }
  Json violations = Json::array();
  for (const metrics::Violation &violation : check.violations) {
    violations.push_back(Json{{"rule", to_string(violation.rule)},
                              {"time_ns", violation.time},
                              {"event", violation.event},
                              {"job", violation.job},
                              {"text", violation.text}});
  }
  return Json{{"ok", check.ok()},
              {"violation_count", check.violation_count},
              {"not_judged", check.not_judged},
              {"rules", rules},
              {"violations", violations}};
}

Json to_json(const lab::Session &session) {
  Json document = Json::parse(metrics::summary_to_json(session.summary, session.info));
  Json check = to_json(session.check);
  check["until_ns"] = session.cut_at.value_or(session.info.end);
  document["check"] = std::move(check);
  if (has_bounds(session)) document["bounds"] = to_json(lab::check_bounds(session));
  document["stopped"] = session.stopped;
  document["warnings"] = session.warnings;
  return document;
}

WrittenFiles write_session(lab::Session &session, const metrics::FilesOptions &options) {
  WrittenFiles written;
  const auto keep = [&written](const Diagnostics &problems) {
    written.problems.insert(written.problems.end(), problems.begin(), problems.end());
  };
  if (!session.files) {
    Result<metrics::RunFiles> files = metrics::RunFiles::create(options, session.trace.info);
    if (files) {
      files->add(session.trace.events);
      session.files = std::make_unique<metrics::RunFiles>(*std::move(files));
    } else {
      keep(files.error());
    }
  }
  const std::string summary = options.folder + "/summary.json";
  if (const Result<void> done = metrics::write_summary(summary, session.summary, session.info); !done)
    keep(done.error());
  if (session.files) {
    keep(session.files->commit(session.cut_at.value_or(session.info.end), session.info.lost_events));
    written.names = "summary.json, " + session.files->names();
    written.has_picture = session.files->has_picture();
    if (!written.has_picture) {
      written.no_picture = fmt::format(
          "no trace.pftrace: the run has more than {0} events\n"
          "('redag events {1} --format perfetto -o {1}/trace.pftrace' makes one)\n",
          format_count(metrics::kMostPicturedEvents), options.folder);
    }
  }
  return written;
}

}  // namespace redag::cli
