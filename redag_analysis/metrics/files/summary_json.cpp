// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/files/summary_json.hpp"

#include <nlohmann/json.hpp>
#include <utility>

#include "redag/trace/output_file.hpp"
#include "redag/trace/run_info_json.hpp"

namespace redag::metrics {
namespace {

using Json = nlohmann::ordered_json;

// Lost jobs by reason; reasons that did not occur are omitted.
Json reasons_to_json(const JobCounts &stats) {
  Json json = Json::object();
  for (std::size_t i = 0; i < kReasonCount; ++i) {
    if (stats.by_reason[i] > 0) json[to_string(static_cast<Reason>(i))] = stats.by_reason[i];
  }
  return json;
}

Json to_json(const JobStats &stats) {
  Json json = to_json(static_cast<const JobCounts &>(stats));
  json["response"] = to_json(stats.response);
  json["response_from_ready"] = to_json(stats.response_from_ready);
  json["start_latency"] = to_json(stats.start_latency);
  json["on_worker"] = to_json(stats.on_worker);
  return json;
}

Json to_json(const TaskSummary &task) {
  Json json = {{"id", task.task.value}, {"dag", task.dag}, {"name", task.name}};
  json.update(to_json(task.jobs));
  return json;
}

Json to_json(const DagSummary &dag) {
  Json json = {{"name", dag.name}, {"max_active", dag.max_active}, {"peak_active", dag.peak_active}};
  json.update(to_json(dag.jobs));
  json["end_to_end"] = to_json(dag.end_to_end);
  return json;
}

template <class Row>
Json rows_to_json(const std::vector<Row> &rows) {
  Json json = Json::array();
  for (const Row &row : rows) json.push_back(to_json(row));
  return json;
}

}  // namespace

Json to_json(const Distribution &distribution) {
  Json json = {{"count", distribution.count}, {"mean_ns", distribution.mean}, {"min_ns", distribution.min},
               {"p50_ns", distribution.p50},  {"p90_ns", distribution.p90},   {"p95_ns", distribution.p95},
               {"p99_ns", distribution.p99},  {"max_ns", distribution.max}};
  if (distribution.percentile_error > 0) json["percentile_error"] = distribution.percentile_error;
  return json;
}

Json to_json(const JobCounts &stats) {
  return {{"released", stats.released},
          {"finished", stats.finished},
          {"skipped", stats.skipped},
          {"aborted", stats.aborted},
          {"in_flight", stats.in_flight},
          {"lost_by_reason", reasons_to_json(stats)},
          {"deferred", stats.deferred},
          {"exceeded", stats.exceeded},
          {"late", stats.late},
          {"overdue", stats.overdue},
          {"missed", stats.missed()},
          {"miss_ratio", stats.miss_ratio()},
          {"miss_ratio_with_lost", stats.miss_ratio_with_lost()},
          {"max_lateness_ns", stats.max_lateness ? Json(*stats.max_lateness) : Json(nullptr)},
          {"preemptions", stats.preemptions}};
}

Json to_json(const EndToEnd &end_to_end) {
  Json sinks = Json::array();
  for (const SinkSummary &sink : end_to_end.sinks) {
    sinks.push_back(
        Json{{"id", sink.task.value}, {"due", sink.due}, {"late", sink.late}, {"response", to_json(sink.response)}});
  }
  return Json{{"deadline_ns", end_to_end.deadline},
              {"late", end_to_end.late},
              {"response", to_json(end_to_end.response)},
              {"sinks", std::move(sinks)}};
}

std::string summary_to_json(const Summary &summary, const trace::RunInfo &run) {
  Json json = {{"format", "redag.summary/2"}};
  if (run.provenance.is_known()) json["provenance"] = Json::parse(provenance_to_json(run.provenance));
  json.update(Json{{"run", Json::parse(trace::run_info_to_json(run))},
                   {"begin_ns", summary.begin},
                   {"end_ns", summary.end},
                   {"total", to_json(summary.total)},
                   {"dags", rows_to_json(summary.dags)},
                   {"tasks", rows_to_json(summary.tasks)},
                   {"all_enforced", summary.all_enforced},
                   {"group_overlaps", summary.group_overlaps},
                   {"inversions",
                    {{"count", summary.inversions.count},
                     {"total_ns", summary.inversions.total},
                     {"longest_ns", summary.inversions.longest}}},
                   {"high_mode", {{"count", summary.high_mode.count}, {"total_ns", summary.high_mode.total}}},
                   {"worker_busy", summary.worker_busy},
                   {"lost_events", summary.lost_events},
                   {"ignored_events", summary.ignored_events}});
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<void> write_summary(const std::string &path, const Summary &summary, const trace::RunInfo &run) {
  Result<trace::OutputFile> file = trace::OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  file->write(summary_to_json(summary, run));
  return file->commit();
}

}  // namespace redag::metrics
