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

void Group::add(const std::string &path, const trace::Trace &trace, const metrics::KernelRecord *kernel) {
  REDAG_CHECK(fits(trace.info), "jobs of different runs counted together");
  const std::vector<JobRecord> jobs = metrics::fold_jobs(trace.info.workload, trace.events);
  const bool is_first = runs_.empty();
  if (is_first) {
    take_first(trace, jobs);
    why_ = why_of(trace, kernel, schedule_);
  }
  const auto bound_of = [this](TaskId task) {
    return task.value < bounds_.tasks.size() ? bounds_.tasks[task.value].response.value_or(0) : Duration{0};
  };
  metrics::AssumptionCheck check = metrics::check_assumptions(trace.info, trace.events, bound_of);
  if (is_first) {
    assumptions_ = std::move(check);
  } else {
    assumptions_.add(check);
  }
  take(path, trace.info, jobs);
  runs_.push_back(RunDigest{path, trace.info, metrics::summarize(trace),
                            metrics::check_trace(trace, metrics::rules_for(trace.info))});
}

void Group::take_first(const trace::Trace &trace, const std::vector<JobRecord> &jobs) {
  const std::vector<TaskRef> refs = flatten(trace.info.workload);
  is_sink_ = metrics::sinks_of(trace.info.workload);
  for (const TaskRef &ref : refs) dag_of_.push_back(ref.dag);
  samples_.resize(refs.size());
  end_to_end_.resize(refs.size());
  bounds_ = bounds_of(trace.info);
  schedule_ = schedule_of(trace, jobs, options_.most_slices, options_.most_views);
  timeline_ = timeline_of(trace, slices_of(trace), services_of(trace), jobs, options_.most_bins);
}

void Group::take(const std::string &path, const trace::RunInfo &info, const std::vector<JobRecord> &jobs) {
  for (const JobRecord &job : jobs) {
    if (job.release < info.start + info.warm_up || job.outcome != JobOutcome::Finished) continue;
    Samples &samples = samples_[job.task.value];
    samples.response.push_back(job.response());
    samples.lateness.add(job.lateness(), std::max<Duration>(1, job.deadline - job.release));
    samples.execution_max = std::max(samples.execution_max, job.processor == kNever ? job.on_worker : job.processor);
    if (is_sink_[job.task.value]) end_to_end_[job.task.value].push_back(job.finish - job.origin);
    if (!latest_ || relative_lateness(job) > relative_lateness(latest_->record)) {
      latest_ = LatestJob{job, path, job.release - info.start};
    }
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
    sink.response = metrics::distribution_of(std::move(end_to_end_[sink.task.value]));
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
    std::vector<Duration> &response = samples_[t].response;
    std::sort(response.begin(), response.end());
    task_stats_[t].response = metrics::distribution_of(response);
  }
  for (std::size_t d = 0; d < workload().dags.size(); ++d) dags_.push_back(pooled(DagId(d)));
}

}  // namespace redag::report
