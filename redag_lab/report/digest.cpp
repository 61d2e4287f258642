// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/digest.hpp"

#include <algorithm>
#include <limits>

#include "redag/base/check.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::report {
namespace {

using metrics::DurationSketch;
using metrics::JobRecord;

bool same_tasks(const Workload &a, const Workload &b) {
  const auto same_task = [](const Task &x, const Task &y) { return x.name == y.name; };
  const auto same_dag = [&](const Dag &x, const Dag &y) {
    return x.name == y.name && std::equal(x.tasks.begin(), x.tasks.end(), y.tasks.begin(), y.tasks.end(), same_task);
  };
  return std::equal(a.dags.begin(), a.dags.end(), b.dags.begin(), b.dags.end(), same_dag);
}

// Returns the misses of a run, and the largest lateness as a share of the deadline.
std::pair<std::uint64_t, double> badness(const metrics::Summary &summary, const Workload &workload) {
  std::pair<std::uint64_t, double> worst{summary.total.missed(), -std::numeric_limits<double>::infinity()};
  for (const metrics::DagSummary &dag : summary.dags) worst.first += dag.end_to_end.late;
  for (const TaskRef &ref : flatten(workload)) {
    const std::optional<Duration> &lateness = summary.tasks[ref.id.value].jobs.max_lateness;
    const auto deadline = static_cast<double>(std::max<Duration>(1, ref.task->deadline));
    if (lateness) worst.second = std::max(worst.second, static_cast<double>(*lateness) / deadline);
  }
  return worst;
}

}  // namespace

bool GroupReader::fits(const trace::RunInfo &run) const {
  if (group_.runs.empty()) return true;
  const trace::RunInfo &first = group_.info();
  return run.executor == first.executor && run.preemption == first.preemption && run.driver == first.driver &&
         trace::worker_count(run) == trace::worker_count(first) && same_tasks(run.workload, first.workload);
}

Result<void> GroupReader::add(const std::string &path, const trace::Recording &run) {
  REDAG_CHECK(fits(run.info()), "jobs of different runs counted together");
  const bool is_first = group_.runs.empty();
  if (is_first) {
    const std::size_t tasks = run.info().workload.task_count();
    responses_.assign(tasks, DurationSketch(metrics::exact_jobs_of_task(tasks, options_.exact_jobs)));
    end_to_end_ = responses_;
    group_.executions.assign(tasks, 0);
    is_sink_ = metrics::sinks_of(run.info().workload);
    group_.bounds = bounds_of(run.info());
  }
  Result<RunDigest> digest = read(path, run);
  if (!digest) return tl::unexpected<Diagnostics>(std::move(digest.error()));
  const auto bad = badness(digest->summary, run.info().workload);
  if (is_first || bad > worst_) {
    group_.worst_run = group_.runs.size();
    worst_ = bad;
    if (Result<void> explained = explain(run); !explained) return explained;
  }
  const auto bound_of = [this](TaskId task) {
    return task.value < group_.bounds.tasks.size() ? group_.bounds.tasks[task.value].response.value_or(0) : Duration{0};
  };
  Result<metrics::AssumptionCheck> check = metrics::check_assumptions(run, bound_of);
  if (!check) return tl::unexpected<Diagnostics>(std::move(check.error()));
  if (is_first) {
    group_.assumptions = *std::move(check);
  } else {
    group_.assumptions.add(*check);
  }
  group_.runs.push_back(*std::move(digest));
  return {};
}

// Counts all that one pass over the events can count.
Result<RunDigest> GroupReader::read(const std::string &path, const trace::Recording &run) {
  const trace::RunInfo &info = run.info();
  metrics::Summarizer summarizer(info, options_.exact_jobs);
  metrics::TraceChecker checker(info, metrics::rules_for(info));
  metrics::JobFolder jobs(info.workload);
  const Result<void> visited = run.visit([&](std::span<const JobEvent> events) {
    summarizer.add(events);
    if (info.lost_events == 0) checker.add(events);
    jobs.add(events);
    jobs.drain_ended([&](const JobRecord &job) {
      if (job.release >= info.start + info.warm_up) sample(job);
    });
  });
  if (!visited) return tl::unexpected<Diagnostics>(visited.error());
  return RunDigest{path, info, summarizer.finish(info.end), checker.finish(info.end, info.lost_events)};
}

Result<void> GroupReader::explain(const trace::Recording &run) {
  const Result<metrics::Investigation> investigation = metrics::Investigation::of(run, options_.most_explained);
  if (!investigation) return tl::unexpected<Diagnostics>(investigation.error());
  Result<WhyDigest> why = why_of(*investigation, options_.most_views);
  if (!why) return tl::unexpected<Diagnostics>(std::move(why.error()));
  group_.why = *std::move(why);
  Result<Schedule> schedule = schedule_of(run, group_.why.worst_of_dag, options_.most_slices);
  if (!schedule) return tl::unexpected<Diagnostics>(std::move(schedule.error()));
  group_.schedule = *std::move(schedule);
  return {};
}

void GroupReader::sample(const JobRecord &job) {
  if (job.outcome != metrics::JobOutcome::Finished) return;
  responses_[job.task.value].add(job.response());
  Duration &longest = group_.executions[job.task.value];
  longest = std::max(longest, job.processor == kNever ? job.on_worker : job.processor);
  if (is_sink_[job.task.value]) end_to_end_[job.task.value].add(job.finish - job.origin);
}

metrics::DagSummary GroupReader::pooled(DagId dag) const {
  metrics::DagSummary all = group_.runs.front().summary.dags[dag.value];
  for (std::size_t r = 1; r < group_.runs.size(); ++r) {
    const metrics::DagSummary &one = group_.runs[r].summary.dags[dag.value];
    all.jobs.add_counts(one.jobs);
    all.peak_active = std::max(all.peak_active, one.peak_active);
    for (std::size_t s = 0; s < all.end_to_end.sinks.size(); ++s) {
      all.end_to_end.sinks[s].due += one.end_to_end.sinks[s].due;
      all.end_to_end.sinks[s].late += one.end_to_end.sinks[s].late;
    }
  }
  for (metrics::SinkSummary &sink : all.end_to_end.sinks) sink.response = end_to_end_[sink.task.value].distribution();
  all.end_to_end.conclude();
  return all;
}

Group GroupReader::finish() {
  REDAG_CHECK(!group_.runs.empty(), "a group without runs");
  for (std::size_t t = 0; t < responses_.size(); ++t) {
    metrics::JobStats &task = group_.tasks.emplace_back();
    for (const RunDigest &run : group_.runs) task.add_counts(run.summary.tasks[t].jobs);
    group_.total.add_counts(task);
    task.response = responses_[t].distribution();
  }
  for (std::size_t d = 0; d < group_.workload().dags.size(); ++d) group_.dags.push_back(pooled(DagId(d)));
  return std::move(group_);
}

}  // namespace redag::report
