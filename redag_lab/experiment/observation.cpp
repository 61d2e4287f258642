// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/observation.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/paper_accounting.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
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

Observation observe(const FinishedRun &run) {
  constexpr Duration kPaperStartup = 15 * kMillisecond;
  const trace::RunInfo &info = run.trace.info;
  const std::vector<metrics::JobRecord> jobs = metrics::fold_jobs(info.workload, run.trace.events);
  const std::vector<TaskRef> refs = flatten(info.workload);
  const std::vector<Duration> work = work_of(run.trace, refs.size());
  const auto counted = static_cast<double>(info.end - info.start - info.warm_up);

  const auto describe = [&](const std::string &name, const metrics::JobCounts &stats, std::optional<DagId> dag,
                            const metrics::Distribution &response) {
    DagObservation row{name, stats.released, stats.missed(), {}};
    row.figures[kMissRatio] = ratio(stats.missed(), stats.released);
    row.figures[kDropRatio] = ratio(stats.skipped, stats.released);
    row.figures[kMaxLateness] = stats.max_lateness;
    if (response.count > 0) {
      row.figures[kResponseP50] = response.p50;
      row.figures[kResponseP95] = response.p95;
      row.figures[kResponseP99] = response.p99;
      row.figures[kResponseMax] = response.max;
    }
    const metrics::PaperCount paper = metrics::paper_count(info.workload, jobs, 0, dag);
    row.figures[kPaperMissRatio] = ratio(paper.late, paper.jobs);
    row.figures[kPaperStartupMissRatio] =
        ratio(metrics::paper_count(info.workload, jobs, kPaperStartup, dag).late, paper.jobs);
    row.figures[kPaperMaxLateness] = paper.max_lateness;
    Duration had_workers = 0;
    for (const TaskRef &ref : refs) had_workers += !dag || ref.dag == *dag ? work[ref.id.value] : 0;
    row.figures[kFinishedPerSecond] = static_cast<double>(stats.finished) * kSecond / counted;
    row.figures[kWork] = static_cast<double>(had_workers) / counted;
    return row;
  };

  Observation seen;
  seen.world = trace::to_string(info.driver);
  seen.preemption = info.preemption;
  seen.violations = run.check.violation_count;
  seen.checks = std::accumulate(run.check.checks_by_rule.begin(), run.check.checks_by_rule.end(), std::uint64_t{0});
  seen.enforced = run.summary.all_enforced;
  for (std::size_t d = 0; d < run.summary.dags.size(); ++d) {
    const metrics::DagSummary &dag = run.summary.dags[d];
    seen.dags.push_back(describe(dag.name, dag.jobs, DagId(d), dag.end_to_end.response));
  }
  seen.dags.push_back(describe("total", run.summary.total, std::nullopt, {}));
  return seen;
}

std::string to_line(const Observation &observation) {
  Json dags = Json::array();
  for (const DagObservation &dag : observation.dags) {
    Json figures = Json::array();
    for (const std::optional<double> &figure : dag.figures) figures.push_back(figure ? Json(*figure) : Json());
    dags.push_back(Json::array({dag.dag, dag.released, dag.missed, std::move(figures)}));
  }
  return Json::array({observation.world, observation.preemption, observation.violations, observation.checks,
                      observation.enforced, std::move(dags)})
      .dump();
}

Result<Observation> parse_observation(std::string_view line) {
  try {
    const Json json = Json::parse(line);
    Observation seen{json.at(0).get<std::string>(),   json.at(1).get<std::string>(), json.at(2).get<std::uint64_t>(),
                     json.at(3).get<std::uint64_t>(), json.at(4).get<bool>(),        {}};
    for (const Json &dag : json.at(5)) {
      DagObservation row{
          dag.at(0).get<std::string>(), dag.at(1).get<std::uint64_t>(), dag.at(2).get<std::uint64_t>(), {}};
      for (std::size_t f = 0; f < kFigureCount; ++f) {
        if (const Json &figure = dag.at(3).at(f); !figure.is_null()) row.figures[f] = figure.get<double>();
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
