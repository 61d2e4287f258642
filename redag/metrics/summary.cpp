#include "redag/metrics/summary.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {
namespace {

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::size_t exact_jobs_of(std::size_t tasks) {
  constexpr std::size_t kLeast = 16;  // cheaper than a sketch
  return std::max(kLeast, kExactJobs / std::max<std::size_t>(1, tasks));
}

}  // namespace

void JobStats::add_counts(const JobStats &other) {
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

double JobStats::miss_ratio() const { return ratio(late, released); }

double JobStats::miss_ratio_with_lost() const { return ratio(late + skipped + aborted - no_data(), released); }

void Summarizer::Samples::merge(const Samples &other) {
  response.merge(other.response);
  response_from_ready.merge(other.response_from_ready);
  start_latency.merge(other.start_latency);
  on_worker.merge(other.on_worker);
}

Summarizer::Summarizer(const trace::RunInfo &run)
    : run_(run),
      begin_(run.start + run.warm_up),
      refs_(flatten(run.workload)),
      exact_(exact_jobs_of(refs_.size())),
      is_sink_(refs_.size(), true),
      stats_(refs_.size()),
      samples_(refs_.size(), Samples(exact_)),
      end_to_end_(run.workload.dags.size(), DurationSketch(exact_)),
      end_to_end_late_(run.workload.dags.size()),
      folder_(run.workload),
      activity_(run.workload, run.config, begin_) {
  for (std::size_t t = 0; t < refs_.size(); ++t) {
    for (const std::uint32_t p : refs_[t].task->predecessors) is_sink_[t - refs_[t].index + p] = false;
  }
}

void Summarizer::add(std::span<const JobEvent> events) {
  activity_.add(events);
  folder_.add(events);
  for (const JobRecord &job : folder_.take_ended()) count(job);
}

void Summarizer::count(const JobRecord &job) {
  if (job.release < begin_) return;
  JobStats &stats = stats_[job.task.value];
  ++stats.released;
  if (job.deferred) ++stats.deferred;
  if (job.exceeded) ++stats.exceeded;
  stats.preemptions += job.preemptions;
  Samples &samples = samples_[job.task.value];
  if (job.has_started() && job.reason != Reason::NoData) samples.start_latency.add(job.start - job.ready);
  switch (job.outcome) {
    case JobOutcome::InFlight: ++stats.in_flight; return;
    case JobOutcome::Skipped:
    case JobOutcome::Aborted:
      ++(job.outcome == JobOutcome::Skipped ? stats.skipped : stats.aborted);
      ++stats.by_reason[static_cast<std::size_t>(job.reason) % kReasonCount];
      return;
    case JobOutcome::Finished: break;
  }
  ++stats.finished;
  if (job.lateness() > 0) ++stats.late;
  stats.max_lateness = std::max(stats.max_lateness.value_or(job.lateness()), job.lateness());
  samples.response.add(job.response());
  samples.response_from_ready.add(job.response_from_ready());
  samples.on_worker.add(job.on_worker);
  if (!is_sink_[job.task.value]) return;
  const std::size_t dag = refs_[job.task.value].dag.value;
  const Duration deadline = run_.workload.dags[dag].deadline;
  end_to_end_[dag].add(job.finish - job.origin);
  if (deadline > 0 && job.finish - job.origin > deadline) ++end_to_end_late_[dag];
}

void Summarizer::count_overdue(Time end) {
  for (const JobRecord &job : folder_.in_flight()) {
    count(job);
    if (job.release < begin_ || !job.is_late(end)) continue;
    ++stats_[job.task.value].late;
    ++stats_[job.task.value].overdue;
  }
}

void Summarizer::fill(JobStats &stats, const Samples &samples) {
  stats.response = samples.response.distribution();
  stats.response_from_ready = samples.response_from_ready.distribution();
  stats.start_latency = samples.start_latency.distribution();
  stats.on_worker = samples.on_worker.distribution();
}

Summary Summarizer::finish(Time end) {
  activity_.finish(end);
  count_overdue(end);

  Summary summary;
  summary.begin = begin_;
  summary.end = end;
  Samples all(exact_);
  std::vector<Samples> of_dag(run_.workload.dags.size(), Samples(exact_));
  for (const Dag &dag : run_.workload.dags) {
    DagSummary row;
    row.name = dag.name;
    row.max_active = dag.max_active;
    row.end_to_end.deadline = dag.deadline;
    summary.dags.push_back(std::move(row));
  }
  for (std::size_t t = 0; t < refs_.size(); ++t) {
    const std::size_t d = refs_[t].dag.value;
    summary.dags[d].jobs.add_counts(stats_[t]);
    summary.total.add_counts(stats_[t]);
    of_dag[d].merge(samples_[t]);
    all.merge(samples_[t]);
    fill(stats_[t], samples_[t]);
    samples_[t] = Samples(exact_);
    summary.tasks.push_back(TaskSummary{TaskId(t), summary.dags[d].name, refs_[t].task->name, stats_[t]});
  }
  for (std::size_t d = 0; d < summary.dags.size(); ++d) {
    DagSummary &dag = summary.dags[d];
    fill(dag.jobs, of_dag[d]);
    dag.end_to_end.late = end_to_end_late_[d];
    dag.end_to_end.response = end_to_end_[d].distribution();
    dag.peak_active = activity_.peak_active(DagId(d));
    if (dag.max_active > 0 && dag.peak_active > dag.max_active) summary.all_enforced = false;
  }
  fill(summary.total, all);
  summary.inversions = activity_.inversions();
  summary.high_mode = activity_.high_mode();
  summary.group_overlaps = activity_.group_overlaps();
  if (summary.group_overlaps > 0) summary.all_enforced = false;
  // Jobs in progress at the end may have run on.
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
