// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/digest.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag/trace/worker_count.hpp"
#include "redag_analysis/metrics/miss.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"

namespace redag::report {
namespace {

using metrics::JobOutcome;
using metrics::JobRecord;

double relative_lateness(const JobRecord &job) {
  return static_cast<double>(job.lateness()) / static_cast<double>(std::max<Duration>(1, job.deadline - job.release));
}

bool same_tasks(const Workload &a, const Workload &b) {
  const auto same_task = [](const Task &x, const Task &y) { return x.name == y.name; };
  const auto same_dag = [&](const Dag &x, const Dag &y) {
    return x.name == y.name && std::equal(x.tasks.begin(), x.tasks.end(), y.tasks.begin(), y.tasks.end(), same_task);
  };
  return std::equal(a.dags.begin(), a.dags.end(), b.dags.begin(), b.dags.end(), same_dag);
}

}  // namespace

bool Group::fits(const trace::RunInfo &run) const {
  if (runs_.empty()) return true;
  return run.executor == info().executor && run.preemption == info().preemption && run.driver == info().driver &&
         trace::worker_count(run) == trace::worker_count(info()) && same_tasks(run.workload, workload());
}

Result<void> Group::add(const std::string &path, const trace::Recording &run) {
  REDAG_CHECK(fits(run.info()), "jobs of different runs counted together");
  const bool is_first = runs_.empty();
  if (is_first) begin(run.info());
  Timeline timeline;
  Result<RunDigest> digest = read(path, run, timeline);
  if (!digest) return tl::unexpected<Diagnostics>(std::move(digest.error()));
  const Result<metrics::Investigation> investigation =
      metrics::Investigation::of(run, std::nullopt, options_.most_explained);
  if (!investigation) return tl::unexpected<Diagnostics>(investigation.error());
  if (is_worst(*investigation)) {
    const std::vector<metrics::Subject> closest = investigation->closest(1);
    const std::vector<metrics::Subject> &worst = investigation->misses().empty() ? closest : investigation->misses();
    Result<Schedule> schedule = schedule_of(run, options_.most_slices, options_.most_views,
                                            worst.empty() ? std::nullopt : std::optional(worst.front().job));
    if (!schedule) return tl::unexpected<Diagnostics>(std::move(schedule.error()));
    Result<WhyDigest> why = why_of(*investigation, *schedule);
    if (!why) return tl::unexpected<Diagnostics>(std::move(why.error()));
    worst_run_ = runs_.size();
    most_missed_ = investigation->misses_in_all();
    timeline_ = std::move(timeline);
    schedule_ = *std::move(schedule);
    why_ = *std::move(why);
  }
  const auto bound_of = [this](TaskId task) {
    return task.value < bounds_.tasks.size() ? bounds_.tasks[task.value].response.value_or(0) : Duration{0};
  };
  Result<metrics::AssumptionCheck> check = metrics::check_assumptions(run, bound_of);
  if (!check) return tl::unexpected<Diagnostics>(std::move(check.error()));
  if (is_first) {
    assumptions_ = *std::move(check);
  } else {
    assumptions_.add(*check);
  }
  runs_.push_back(*std::move(digest));
  return {};
}

bool Group::is_worst(const metrics::Investigation &investigation) const {
  if (runs_.empty() || investigation.misses_in_all() > most_missed_) return true;
  return investigation.misses_in_all() == most_missed_ && latest_ && latest_->run == runs_.size();
}

void Group::begin(const trace::RunInfo &info) {
  const std::size_t tasks = info.workload.task_count();
  is_sink_ = metrics::sinks_of(info.workload);
  samples_.resize(tasks);
  responses_.assign(tasks, metrics::DurationSketch(metrics::exact_jobs_of_task(tasks, options_.exact_jobs)));
  end_to_end_ = responses_;
  bounds_ = bounds_of(info);
}

// Counts all that one pass over the events can count.
Result<RunDigest> Group::read(const std::string &path, const trace::Recording &run, Timeline &timeline) {
  const trace::RunInfo &info = run.info();
  metrics::Summarizer summarizer(info, options_.exact_jobs);
  metrics::TraceChecker checker(info, metrics::rules_for(info));
  metrics::JobFolder jobs(info.workload);
  SliceFolder slices(info);
  ServiceFolder services(info);
  TimelineBuilder builder(info, options_.most_bins);
  const auto draw = [&builder](const auto &one) { builder.add(one); };
  const Result<void> visited = run.visit([&](std::span<const JobEvent> events) {
    summarizer.add(events);
    if (info.lost_events == 0) checker.add(events);
    jobs.add(events);
    jobs.drain_ended([&](const JobRecord &job) {
      take(info, job);
      builder.add(job);
    });
    slices.add(events);
    slices.drain(draw);
    services.add(events);
    services.drain(draw);
  });
  if (!visited) return tl::unexpected<Diagnostics>(visited.error());
  for (const JobRecord &job : jobs.in_flight()) builder.add(job);
  slices.finish();
  slices.drain(draw);
  services.finish();
  services.drain(draw);
  timeline = builder.take();
  return RunDigest{path, info, summarizer.finish(info.end), checker.finish(info.end, info.lost_events)};
}

void Group::take(const trace::RunInfo &info, const JobRecord &job) {
  if (job.release < info.start + info.warm_up || job.outcome != JobOutcome::Finished) return;
  Samples &samples = samples_[job.task.value];
  responses_[job.task.value].add(job.response());
  samples.lateness.add(job.lateness(), std::max<Duration>(1, job.deadline - job.release));
  samples.execution_max = std::max(samples.execution_max, job.processor == kNever ? job.on_worker : job.processor);
  if (is_sink_[job.task.value]) end_to_end_[job.task.value].add(job.finish - job.origin);
  const double lateness = relative_lateness(job);
  const double most = latest_ ? relative_lateness(latest_->record) : lateness;
  // Of equal ones the first that was released.
  const bool is_first_of_equals =
      latest_ && lateness == most && latest_->run == runs_.size() && job.sequence < latest_->record.sequence;
  if (!latest_ || lateness > most || is_first_of_equals) {
    latest_ = LatestJob{job, runs_.size()};
  }
}

metrics::DagSummary Group::pooled(DagId dag) {
  metrics::DagSummary all;
  all.name = workload().dags[dag.value].name;
  all.max_active = workload().dags[dag.value].max_active;
  all.end_to_end.deadline = workload().dags[dag.value].deadline;
  for (const RunDigest &run : runs_) {
    const metrics::DagSummary &one = run.summary.dags[dag.value];
    all.jobs.add_counts(one.jobs);
    all.peak_active = std::max(all.peak_active, one.peak_active);
    std::vector<metrics::SinkSummary> &sinks = all.end_to_end.sinks;
    sinks.resize(one.end_to_end.sinks.size());
    for (std::size_t s = 0; s < sinks.size(); ++s) {
      sinks[s].task = one.end_to_end.sinks[s].task;
      sinks[s].due += one.end_to_end.sinks[s].due;
      sinks[s].late += one.end_to_end.sinks[s].late;
    }
  }
  for (metrics::SinkSummary &sink : all.end_to_end.sinks) {
    sink.response = end_to_end_[sink.task.value].distribution();
  }
  all.end_to_end.conclude();
  return all;
}

void Group::finish() {
  REDAG_CHECK(!runs_.empty(), "a group without runs");
  task_stats_.assign(samples_.size(), {});
  for (std::size_t t = 0; t < samples_.size(); ++t) {
    for (const RunDigest &run : runs_) {
      task_stats_[t].add_counts(run.summary.tasks[t].jobs);
      task_stats_[t].split.add(run.summary.tasks[t].jobs.split);
    }
    total_.add_counts(task_stats_[t]);
    task_stats_[t].response = responses_[t].distribution();
    samples_[t].responses = curve_of(responses_[t]);
    samples_[t].is_exact = responses_[t].is_exact();
  }
  for (std::size_t d = 0; d < workload().dags.size(); ++d) dags_.push_back(pooled(DagId(d)));
  responses_.clear();
  end_to_end_.clear();
}

}  // namespace redag::report
