// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes the document `redag.analysis/1`, whose keys docs/cli.md lists.
#include <utility>

#include "redag_analysis/analyze/executors.hpp"
#include "redag_lab/cli/analyze/analysis_report.hpp"

namespace redag::cli {
namespace {

using analysis::Method;
using analysis::MethodReport;

Json duration_json(const std::optional<Duration> &duration) { return duration ? Json(*duration) : Json(); }

// Returns null if the terms were left out (kMostItemised).
Json terms_json(const lab::Analysed &analysed, const analysis::ResponseBound &bound) {
  if (bound.response && bound.terms.empty()) return nullptr;
  Json terms = Json::array();
  for (const analysis::Term &term : bound.terms) {
    terms.push_back(Json{{"kind", to_string(term.kind)},
                         {"dag", term.dag.valid() ? Json(analysed.task_set.dags[term.dag.value].name) : Json()},
                         {"task", term.task.valid() ? Json(task_name(analysed, term.task)) : Json()},
                         {"amount_ns", term.amount},
                         {"jobs", term.jobs},
                         {"device", term.device.valid() ? Json(device_name(analysed, term.device)) : Json()}});
  }
  return terms;
}

Json row_json(const lab::Analysed &analysed, const lab::Row &row) {
  return Json{{"name", row.name},
              {"deadline_ns", row.deadline > 0 ? Json(row.deadline) : Json()},
              {"due_ns", duration_json(row.due)},
              {"bound_ns", duration_json(row.tightest.response)},
              {"slack_ns", duration_json(row.slack)},
              {"verdict", to_string(row.standing)},
              {"method", row.says != nullptr ? Json(std::string(row.says->name)) : Json()},
              {"reason", row.reason},
              {"terms", terms_json(analysed, row.tightest.bound)}};
}

Json bounds_json(const std::vector<analysis::ResponseBound> &bounds, const std::vector<lab::Row> &rows) {
  Json list = Json::array();
  for (std::size_t i = 0; i < bounds.size() && i < rows.size(); ++i) {
    list.push_back(Json{{"name", rows[i].name},
                        {"bound_ns", duration_json(bounds[i].response)},
                        {"reason", std::string(bounds[i].response ? "" : bounds[i].absent)}});
  }
  return list;
}

Json method_json(const Method &method) {
  return Json{{"name", std::string(method.name)},
              {"subject", to_string(method.subject)},
              {"paper", method.is_paper()},
              {"cite", std::string(method.cite)},
              {"assumptions", std::string(method.assumptions)},
              {"complexity", std::string(method.complexity)},
              {"sound_only_if", std::string(method.sound_only_if)}};
}

Json method_json(const MethodReport &report) {
  const analysis::Bound *bound = report.bound();
  Json json = method_json(*report.method);
  json["applies"] = bound != nullptr;
  json["gave_up"] = report.gave_up();
  json["reason"] = bound == nullptr ? std::get<analysis::NotApplicable>(report.outcome).reason : "";
  json["sound"] = report.trusted;
  json["unsound_because"] = bound != nullptr ? bound->unsound : "";
  json["schedulable"] = bound != nullptr && report.verdict == analysis::Verdict::Schedulable;
  json["figures"] = bound != nullptr ? bound->figures : "";
  return json;
}

}  // namespace

Json to_json(const lab::Analysed &analysed, bool each) {
  const analysis::AnalysisPlatform &platform = analysed.task_set.platform;
  Json document = {
      {"format", "redag.analysis/1"},
      {"workload", analysed.workload.name},
      {"executor", std::string(analysed.executor->name)},
      {"policy", to_string(analysed.workload.policy)},
      {"ties", to_string(analysed.workload.ties)},
      {"workers", platform.workers},
      {"preemption", mode_name(analysed)},
      {"preemption_why", mode_reason(analysed)},
      {"levels", platform.levels},
      {"overheads_ns",
       {{"release", platform.release_overhead},
        {"dispatch", platform.dispatch_overhead},
        {"preempt", platform.preempt_overhead},
        {"timer", platform.timer_overhead},
        {"lateness", platform.lateness},
        {"stall", platform.stall.longest},
        {"stall_per_second", platform.stall.per_second}}},
      {"utilization", analysed.task_set.utilization},
      {"schedulable", analysed.report.verdict == analysis::Verdict::Schedulable},
      {"verdict", verdict_in_words(analysed)},
  };
  const std::optional<lab::Row> weakest = lab::weakest_row(analysed);
  document["weakest"] = weakest ? Json(weakest->name) : Json();
  document["by"] = Json::array();
  for (const Method *method : analysed.report.by) document["by"].push_back(std::string(method->name));
  const std::vector<lab::Row> tasks = lab::task_rows(analysed);
  const std::vector<lab::Row> dags = lab::dag_rows(analysed);
  document["tasks"] = Json::array();
  for (const lab::Row &row : tasks) document["tasks"].push_back(row_json(analysed, row));
  document["dags"] = Json::array();
  for (const lab::Row &row : dags) document["dags"].push_back(row_json(analysed, row));
  document["methods"] = Json::array();
  for (const MethodReport &report : analysed.report.methods) {
    document["methods"].push_back(method_json(report));
    if (!each) continue;
    const analysis::Bound *bound = report.bound();
    Json &method = document["methods"].back();
    method["tasks"] = bound != nullptr ? bounds_json(bound->tasks, tasks) : Json::array();
    method["dags"] = bound != nullptr ? bounds_json(bound->dags, dags) : Json::array();
  }
  return document;
}

Json methods_json() {
  Json all = Json::array();
  for (const Method &method : analysis::methods()) all.push_back(method_json(method));
  for (const Method &method : analysis::executor_methods()) all.push_back(method_json(method));
  return Json{{"format", "redag.methods/1"}, {"methods", std::move(all)}};
}

}  // namespace redag::cli
