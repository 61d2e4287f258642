// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/observation.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/trace/worker_count.hpp"
#include "redag_analysis/metrics/distribution.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/paper_accounting.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;
using metrics::JobRecord;

constexpr std::array<const char *, kMeasureCount> kQuantityNames = {
    "released",           "finished",     "late",         "dropped",       "aborted",        "missed",
    "deferred",           "preemptions",  "max_lateness", "response_mean", "response_p50",   "response_p95",
    "response_p99",       "response_max", "peak_active",  "paper_jobs",    "paper_late",     "paper_max_lateness",
    "paper_startup_late", "work",         "answered",     "answers_due",   "end_to_end_late"};

// Returns quantiles of the end-to-end responses by sink. With several sinks, each quantile is the largest of the sinks.
std::vector<Duration> quantiles_of(const trace::RunInfo &info, const std::vector<JobRecord> &jobs,
                                   const metrics::EndToEnd &end_to_end) {
  std::vector<Duration> quantiles;
  for (const metrics::SinkSummary &sink : end_to_end.sinks) {
    std::vector<Duration> responses;
    for (const JobRecord &job : jobs) {
      if (job.task != sink.task || job.outcome != metrics::JobOutcome::Finished) continue;
      if (job.release >= info.start + info.warm_up) responses.push_back(job.finish - job.origin);
    }
    if (responses.empty()) continue;
    std::sort(responses.begin(), responses.end());
    quantiles.resize(kQuantiles.size(), std::numeric_limits<Duration>::min());
    for (std::size_t q = 0; q < kQuantiles.size(); ++q) {
      quantiles[q] = std::max(quantiles[q], metrics::percentile(responses, kQuantiles[q]));
    }
  }
  return quantiles;
}

// Returns the sink with the smallest share of answers; null if no answer was due.
const metrics::SinkSummary *rarest(const metrics::EndToEnd &end_to_end) {
  const metrics::SinkSummary *found = nullptr;
  for (const metrics::SinkSummary &sink : end_to_end.sinks) {
    if (sink.due == 0) continue;
    if (found == nullptr || sink.response.count * found->due < found->response.count * sink.due) found = &sink;
  }
  return found;
}

bool has_measured_end(JobEventKind kind) { return kind == JobEventKind::Finished || kind == JobEventKind::Aborted; }

// Returns for each task the time its jobs had a worker during the counted time. Jobs that still run at the end are
// included: without them, long jobs would seem to use too little.
std::vector<Duration> work_of(const trace::Trace &trace, std::size_t tasks) {
  const Time begin = trace.info.start + trace.info.warm_up;
  std::vector<Duration> work(tasks, 0);
  std::map<std::pair<std::uint32_t, std::uint32_t>, Time> running;  // start of execution, by task and number
  const auto stop = [&](std::uint32_t task, Time since, Time now) {
    work[task] += std::max<Duration>(0, std::min(now, trace.info.end) - std::max(since, begin));
  };
  for (const JobEvent &event : trace.events) {
    if (event.task.value >= tasks) continue;
    const std::pair job(event.task.value, event.job);
    switch (event.kind) {
      case JobEventKind::Dispatched:
      case JobEventKind::Resumed: running[job] = event.time; break;
      case JobEventKind::Preempted:
      case JobEventKind::Waits:
      case JobEventKind::Finished:
      case JobEventKind::Aborted:
        if (const auto at = running.find(job); at != running.end()) {
          stop(job.first, at->second, has_measured_end(event.kind) ? event.value : event.time);
          running.erase(at);
        }
        break;
      default: break;
    }
  }
  for (const auto &[job, since] : running) stop(job.first, since, trace.info.end);
  return work;
}

}  // namespace

const char *to_string(Measure measure) { return kQuantityNames[static_cast<std::size_t>(measure)]; }

Observation observe(const FinishedRun &run, const ObserveOptions &options) {
  const trace::RunInfo &info = run.trace.info;
  const metrics::Summary &summary = run.summary;
  const std::vector<JobRecord> jobs = metrics::fold_jobs(info.workload, run.trace.events);
  const std::vector<TaskRef> refs = flatten(info.workload);
  const std::vector<Duration> work = work_of(run.trace, refs.size());

  const auto describe = [&](const std::string &name, const metrics::JobCounts &stats, std::uint32_t peak,
                            std::optional<DagId> dag, const metrics::EndToEnd &end_to_end) {
    DagObservation row;
    row.dag = name;
    const auto set = [&row](Measure measure, auto value) {
      row.values[static_cast<std::size_t>(measure)] = static_cast<std::int64_t>(value);
    };
    set(Measure::Released, stats.released);
    set(Measure::Finished, stats.finished);
    set(Measure::Late, stats.late);
    set(Measure::Dropped, stats.skipped);
    set(Measure::Aborted, stats.aborted);
    set(Measure::Missed, stats.missed());
    set(Measure::Deferred, stats.deferred);
    set(Measure::Preemptions, stats.preemptions);
    set(Measure::MaxLateness, stats.max_lateness.value_or(kNotMeasured));
    const metrics::Distribution &response = end_to_end.response;
    const auto set_response = [&](Measure measure, std::int64_t value) {
      set(measure, response.count > 0 ? value : kNotMeasured);
    };
    set_response(Measure::ResponseMean, std::llround(response.mean));
    set_response(Measure::ResponseP50, response.p50);
    set_response(Measure::ResponseP95, response.p95);
    set_response(Measure::ResponseP99, response.p99);
    set_response(Measure::ResponseMax, response.max);
    const metrics::SinkSummary *sink = rarest(end_to_end);
    set(Measure::Answered, sink == nullptr ? 0 : sink->response.count);
    set(Measure::AnswersDue, sink == nullptr ? 0 : sink->due);
    set(Measure::EndToEndLate, end_to_end.late);
    set(Measure::PeakActive, peak);
    const metrics::PaperCount paper = metrics::paper_count(info.workload, jobs, 0, dag);
    set(Measure::PaperJobs, paper.jobs);
    set(Measure::PaperLate, paper.late);
    set(Measure::PaperMaxLateness, paper.max_lateness.value_or(kNotMeasured));
    set(Measure::PaperStartupLate, metrics::paper_count(info.workload, jobs, options.paper_startup, dag).late);
    Duration had_workers = 0;
    for (const TaskRef &ref : refs) had_workers += !dag || ref.dag == *dag ? work[ref.id.value] : 0;
    set(Measure::Work, had_workers);
    if (options.quantiles) row.quantiles = quantiles_of(info, jobs, end_to_end);
    return row;
  };

  Observation seen;
  seen.seed = info.seed;
  seen.world = trace::to_string(info.driver);
  seen.preemption = info.preemption;
  seen.workers = trace::worker_count(info);
  seen.violations = run.check.violation_count;
  seen.check_count =
      std::accumulate(run.check.checks_by_rule.begin(), run.check.checks_by_rule.end(), std::uint64_t{0});
  seen.enforced = summary.all_enforced;
  std::uint32_t peak = 0;
  for (std::size_t d = 0; d < summary.dags.size(); ++d) {
    const metrics::DagSummary &dag = summary.dags[d];
    seen.dags.push_back(describe(dag.name, dag.jobs, dag.peak_active, DagId(d), dag.end_to_end));
    peak = std::max(peak, dag.peak_active);
  }
  seen.dags.push_back(describe("total", summary.total, peak, std::nullopt, {}));
  return seen;
}

std::string to_line(const Observation &observation) {
  Json dags = Json::array();
  for (const DagObservation &dag : observation.dags) dags.push_back(Json::array({dag.dag, dag.values, dag.quantiles}));
  return Json::array({observation.seed, observation.world, observation.preemption, observation.workers,
                      observation.violations, observation.enforced, observation.check_count, std::move(dags)})
      .dump();
}

Result<Observation> parse_observation(std::string_view line) {
  try {
    const Json json = Json::parse(line);
    Observation seen;
    seen.seed = json.at(0).get<std::uint64_t>();
    seen.world = json.at(1).get<std::string>();
    seen.preemption = json.at(2).get<std::string>();
    seen.workers = json.at(3).get<std::uint32_t>();
    seen.violations = json.at(4).get<std::uint64_t>();
    seen.enforced = json.at(5).get<bool>();
    seen.check_count = json.at(6).get<std::uint64_t>();
    for (const Json &dag : json.at(7)) {
      DagObservation row;
      row.dag = dag.at(0).get<std::string>();
      if (dag.at(1).size() != kMeasureCount) return make_error("an observation has other measures than expected");
      row.values = dag.at(1).get<std::array<std::int64_t, kMeasureCount>>();
      row.quantiles = dag.at(2).get<std::vector<Duration>>();
      if (!row.quantiles.empty() && row.quantiles.size() != kQuantiles.size()) {
        return make_error("an observation has other quantiles than expected");
      }
      seen.dags.push_back(std::move(row));
    }
    if (seen.dags.empty()) return make_error("an observation has no DAGs");
    return seen;
  } catch (const nlohmann::json::exception &problem) {
    return make_error(fmt::format("this is not an observation: {}", problem.what()));
  }
}

}  // namespace redag::experiment
