// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes the results of a run as files and as text.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "redag/base/text.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/files/run_files.hpp"
#include "redag_analysis/metrics/files/summary_json.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/words.hpp"
#include "workload_run.hpp"

namespace redag_rclcpp::lab {

using redag::metrics::CheckReport;
using redag::metrics::Distribution;

namespace {

nlohmann::ordered_json to_json(const CheckReport &check) {
  nlohmann::ordered_json rules = nlohmann::ordered_json::object();
  for (std::size_t i = 0; i < redag::metrics::kRuleCount; ++i) {
    if (check.checks_by_rule[i] == 0) continue;
    rules[to_string(static_cast<redag::metrics::Rule>(i))] = {{"checks", check.checks_by_rule[i]},
                                                              {"violations", check.violations_by_rule[i]}};
  }
  nlohmann::ordered_json violations = nlohmann::ordered_json::array();
  for (const redag::metrics::Violation &violation : check.violations) violations.push_back(violation.to_string());
  return {{"ok", check.ok()}, {"violation_count", check.violation_count}, {"rules", rules}, {"violations", violations}};
}

redag::Result<void> write_check(const std::string &path, const WorkloadRun &run) {
  nlohmann::ordered_json document = {{"format", "redag.check/1"}};
  document["provenance"] = nlohmann::ordered_json::parse(redag::provenance_to_json(run.trace.info.provenance));
  document["nodes"] = to_json(run.check);
  if (run.scheduler) document["scheduler"] = to_json(run.scheduler->check);
  document["stopped"] = run.stopped;
  document["warnings"] = run.warnings;
  return redag::trace::OutputFile::create(path).and_then([&](redag::trace::OutputFile file) {
    file.write(document.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
    return file.commit();
  });
}

std::string verdict(const char *what, const CheckReport &check) {
  const std::uint64_t checks =
      std::accumulate(check.checks_by_rule.begin(), check.checks_by_rule.end(), std::uint64_t{0});
  const auto rules = std::count_if(check.checks_by_rule.begin(), check.checks_by_rule.end(),
                                   [](std::uint64_t count) { return count > 0; });
  return fmt::format("{}: {}, {} checks of {} rules\n{}", what,
                     check.ok() ? std::string("ok") : fmt::format("{} violations", check.violation_count), checks,
                     rules, check.ok() ? "" : check.to_string());
}

std::string time_text(const Distribution &distribution, redag::Duration Distribution::*value) {
  return distribution.count > 0 ? redag::humanize_duration(distribution.*value) : "-";
}

}  // namespace

redag::Diagnostics write_results(const WorkloadRun &run, const std::string &folder) {
  redag::Diagnostics problems;
  const auto keep = [&problems](const redag::Result<void> &written) {
    if (!written) problems.insert(problems.end(), written.error().begin(), written.error().end());
  };
  const redag::trace::Trace &trace = run.trace;
  keep(redag::metrics::write_summary(folder + "/summary.json", run.summary, trace.info));
  if (const auto written = redag::metrics::write_run_files({.folder = folder}, trace); !written) {
    problems.insert(problems.end(), written.error().begin(), written.error().end());
  }
  if (run.scheduler) keep(redag::trace::write_trace(folder + "/scheduler_events.redag", run.scheduler->trace));
  keep(write_check(folder + "/check.json", run));
  return problems;
}

std::string describe(const WorkloadRun &run) {
  const redag::trace::RunInfo &info = run.trace.info;
  std::string text = fmt::format("{}: {}, {}, {} as ROS 2 nodes, seed {}\npreemption: {}{}\n{}\n", info.workload.name,
                                 info.executor, redag::plural(info.workload.platform.workers, "thread"),
                                 redag::humanize_duration(info.end - info.start), info.seed, info.preemption,
                                 info.preemption_why.empty() ? "" : " (" + info.preemption_why + ")", info.overheads);
  if (info.warm_up > 0)
    text += fmt::format("warm-up: the first {} are not counted\n", redag::humanize_duration(info.warm_up));
  if (run.stopped) text += "stopped early: the results cover only the time until then\n";
  redag::Table tasks({{"task"},
                      {"jobs", true},
                      {"late", true},
                      {"skipped", true},
                      {"aborted", true},
                      {"missed", true},
                      {"p50", true},
                      {"p95", true},
                      {"p99", true},
                      {"max", true}});
  for (const redag::metrics::TaskSummary &task : run.summary.tasks) {
    const redag::metrics::JobStats &jobs = task.jobs;
    tasks.add({{task.dag + "." + task.name},
               {fmt::format("{}", jobs.released)},
               {fmt::format("{}", jobs.late)},
               {fmt::format("{}", jobs.skipped)},
               {fmt::format("{}", jobs.aborted)},
               {redag::format_count_and_share(jobs.missed(), jobs.released)},
               {time_text(jobs.response, &Distribution::p50)},
               {time_text(jobs.response, &Distribution::p95)},
               {time_text(jobs.response, &Distribution::p99)},
               {time_text(jobs.response, &Distribution::max)}});
  }
  redag::Table dags({{"DAG"},
                     {"jobs", true},
                     {"missed", true},
                     {"end-to-end p50", true},
                     {"p99", true},
                     {"max", true},
                     {"active", true}});
  for (const redag::metrics::DagSummary &dag : run.summary.dags) {
    const Distribution &end_to_end = dag.end_to_end.response;
    dags.add({{dag.name},
              {fmt::format("{}", dag.jobs.released)},
              {redag::format_count_and_share(dag.jobs.missed(), dag.jobs.released)},
              {time_text(end_to_end, &Distribution::p50)},
              {time_text(end_to_end, &Distribution::p99)},
              {time_text(end_to_end, &Distribution::max)},
              {fmt::format("{}/{}", dag.peak_active, dag.max_active > 0 ? fmt::format("{}", dag.max_active) : "-")}});
  }
  text += "\n" + tasks.render(0, false) + "\n" + dags.render(0, false) + "\n";
  text +=
      "missed: late, skipped or aborted\n"
      "times of tasks: finish - release\n"
      "times of DAGs: end to end, from the release of a source to the finish of a sink\n";
  text += verdict("trace check of the jobs, as the nodes saw them", run.check);
  if (run.scheduler) text += verdict("trace check of the scheduler's decisions", run.scheduler->check);
  return text;
}

}  // namespace redag_rclcpp::lab
