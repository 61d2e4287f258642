// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/summary.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {
namespace {

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

// Returns, by task of a DAG, how many of its jobs the releases of its sources ask for. A timer is released by itself. A
// data task is released once all its predecessors have ended: at most as often as the rarest of them.
std::vector<std::uint64_t> answers_due(const Dag &dag, std::span<const JobStats> stats) {
  const std::vector<std::uint32_t> ranks = topological_ranks(dag);
  std::vector<std::size_t> order(ranks.size());
  for (std::size_t i = 0; i < ranks.size(); ++i) order[ranks[i]] = i;
  std::vector<std::uint64_t> due(ranks.size());
  for (const std::size_t i : order) {
    const Task &task = dag.tasks[i];
    due[i] = stats[i].released;
    if (task.activation != Activation::Data || task.predecessors.empty()) continue;
    due[i] = due[task.predecessors.front()];
    for (const std::uint32_t p : task.predecessors) due[i] = std::min(due[i], due[p]);
  }
  return due;
}

}  // namespace

void JobCounts::count(const JobRecord &job, Miss miss) {
  ++released;
  if (job.deferred) ++deferred;
  if (job.exceeded) ++exceeded;
  preemptions += job.preemptions;
  if (miss == Miss::Deadline) ++late;
  switch (job.outcome) {
    case JobOutcome::InFlight:
      ++in_flight;
      if (miss == Miss::Deadline) ++overdue;
      break;
    case JobOutcome::Skipped:
    case JobOutcome::Aborted:
      ++(job.outcome == JobOutcome::Skipped ? skipped : aborted);
      ++by_reason[static_cast<std::size_t>(job.reason) % kReasonCount];
      break;
    case JobOutcome::Finished:
      ++finished;
      max_lateness = std::max(max_lateness.value_or(job.lateness()), job.lateness());
      break;
  }
}

void JobCounts::add_counts(const JobCounts &other) {
  released += other.released;
  finished += other.finished;
  skipped += other.skipped;
  aborted += other.aborted;
  in_flight += other.in_flight;
  deferred += other.deferred;
  exceeded += other.exceeded;
  late += other.late;
  overdue += other.overdue;
  preemptions += other.preemptions;
  for (std::size_t i = 0; i < kReasonCount; ++i) by_reason[i] += other.by_reason[i];
  if (other.max_lateness) max_lateness = std::max(max_lateness.value_or(*other.max_lateness), *other.max_lateness);
}

double JobCounts::miss_ratio() const { return ratio(late, released); }

double JobCounts::miss_ratio_with_lost() const { return ratio(missed(), released); }

void EndToEnd::conclude() {
  late = 0;
  std::vector<Distribution> responses;
  for (const SinkSummary &sink : sinks) {
    late += sink.late;
    responses.push_back(sink.response);
  }
  response = worst_of(responses);
}

std::uint64_t EndToEnd::due() const {
  std::uint64_t all = 0;
  for (const SinkSummary &sink : sinks) all += sink.due;
  return all;
}

std::size_t exact_jobs_of_task(std::size_t tasks, std::size_t exact_jobs) {
  return std::max<std::size_t>(16, exact_jobs / std::max<std::size_t>(1, tasks));
}

Summarizer::Summarizer(const trace::RunInfo &run, std::size_t exact_jobs)
    : run_(run),
      begin_(run.start + run.warm_up),
      refs_(flatten(run.workload)),
      exact_(exact_jobs_of_task(refs_.size(), exact_jobs)),
      is_sink_(sinks_of(run.workload)),
      end_to_end_deadlines_(end_to_end_deadlines(run.workload)),
      stats_(refs_.size()),
      samples_(refs_.size(), Samples(exact_)),
      end_to_end_(refs_.size(), DurationSketch(exact_)),
      end_to_end_late_(refs_.size()),
      missed_(run.workload.dags.size()),
      folder_(run.workload),
      activity_(run.workload, run.config, begin_) {}

void Summarizer::add(std::span<const JobEvent> events) {
  activity_.add(events);
  folder_.add(events);
  folder_.drain_ended([this](const JobRecord &job) { count(job, job.finish); });
}

void Summarizer::count(const JobRecord &job, Time end) {
  if (job.release < begin_) return;
  const std::size_t task = job.task.value;
  const std::size_t dag = refs_[task].dag.value;
  const Miss miss = miss_of(job, end);
  stats_[task].count(job, miss);
  if (miss != Miss::None) ++missed_[dag];
  if (is_late_end_to_end(job, end, end_to_end_deadlines_[task])) ++end_to_end_late_[task];
  Samples &samples = samples_[task];
  if (job.has_started() && job.reason != Reason::NoData) samples.start_latency.add(job.start - job.ready);
  if (job.outcome != JobOutcome::Finished) return;
  samples.response.add(job.response());
  samples.response_from_ready.add(job.response_from_ready());
  samples.on_worker.add(job.on_worker);
  if (is_sink_[task]) end_to_end_[task].add(job.finish - job.origin);
}

void Summarizer::count_in_flight(Time end) {
  for (const JobRecord &job : folder_.in_flight()) count(job, end);
}

EndToEnd Summarizer::end_to_end_of(DagId dag, std::size_t first_task) const {
  const Dag &spec = run_.workload.dags[dag.value];
  EndToEnd end_to_end;
  end_to_end.deadline = spec.deadline;
  const std::vector<std::uint64_t> due = answers_due(spec, std::span(stats_).subspan(first_task, spec.tasks.size()));
  for (std::size_t i = 0; i < spec.tasks.size(); ++i) {
    const std::size_t t = first_task + i;
    if (!is_sink_[t]) continue;
    end_to_end.sinks.push_back({TaskId(t), due[i], end_to_end_late_[t], end_to_end_[t].distribution()});
  }
  end_to_end.conclude();
  return end_to_end;
}

void Summarizer::fill(JobStats &stats, const Samples &samples) {
  stats.response = samples.response.distribution();
  stats.response_from_ready = samples.response_from_ready.distribution();
  stats.start_latency = samples.start_latency.distribution();
  stats.on_worker = samples.on_worker.distribution();
}

Summary Summarizer::finish(Time end) {
  activity_.finish(end);
  count_in_flight(end);

  Summary summary;
  summary.begin = begin_;
  summary.end = end;
  std::size_t first_task = 0;
  for (std::size_t d = 0; d < run_.workload.dags.size(); ++d) {
    const Dag &dag = run_.workload.dags[d];
    DagSummary row;
    row.name = dag.name;
    row.max_active = dag.max_active;
    row.peak_active = activity_.peak_active(DagId(d));
    row.end_to_end = end_to_end_of(DagId(d), first_task);
    first_task += dag.tasks.size();
    if (row.max_active > 0 && row.peak_active > row.max_active) summary.all_enforced = false;
    summary.dags.push_back(std::move(row));
  }
  for (std::size_t t = 0; t < refs_.size(); ++t) {
    const std::size_t d = refs_[t].dag.value;
    summary.dags[d].jobs.add_counts(stats_[t]);
    summary.total.add_counts(stats_[t]);
    fill(stats_[t], samples_[t]);
    samples_[t] = Samples(exact_);
    summary.tasks.push_back(TaskSummary{TaskId(t), summary.dags[d].name, refs_[t].task->name, stats_[t]});
  }
  summary.inversions = activity_.inversions();
  summary.high_mode = activity_.high_mode();
  summary.group_overlaps = activity_.group_overlaps();
  if (summary.group_overlaps > 0) summary.all_enforced = false;
  // Jobs in progress at the end may have continued.
  const Time last = std::max(end, activity_.last_time());
  const double length = static_cast<double>(std::max<Duration>(1, last - begin_));
  for (const Duration busy : activity_.busy()) summary.worker_busy.push_back(static_cast<double>(busy) / length);
  summary.lost_events = run_.lost_events;
  summary.ignored_events = folder_.ignored_events();
  return summary;
}

Summary summarize(const trace::Trace &trace) {
  Summarizer summarizer(trace.info);
  summarizer.add(trace.events);
  return summarizer.finish(trace.info.end);
}

}  // namespace redag::metrics
