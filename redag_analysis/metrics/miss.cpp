// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/miss.hpp"

namespace redag::metrics {
namespace {

// The earliest time at which the job can have answered.
Time answered(const JobRecord &job, Time end) { return job.outcome == JobOutcome::InFlight ? end : job.finish; }

}  // namespace

bool has_no_response(const JobRecord &job) {
  return job.outcome == JobOutcome::Skipped || job.outcome == JobOutcome::Aborted;
}

bool is_lost(const JobRecord &job) { return has_no_response(job) && job.reason != Reason::NoData; }

bool is_late_end_to_end(const JobRecord &job, Time end, Duration deadline) {
  if (deadline == 0 || has_no_response(job) || job.origin == kNever) return false;
  return answered(job, end) - job.origin > deadline;
}

std::vector<bool> sinks_of(const Workload &workload) {
  std::vector<bool> sinks;
  for (const Dag &dag : workload.dags) {
    const std::size_t first = sinks.size();
    sinks.resize(first + dag.tasks.size(), true);
    for (const Task &task : dag.tasks) {
      for (const std::uint32_t p : task.predecessors) sinks[first + p] = false;
    }
  }
  return sinks;
}

std::vector<Duration> end_to_end_deadlines(const Workload &workload) {
  const std::vector<bool> is_sink = sinks_of(workload);
  std::vector<Duration> deadlines;
  deadlines.reserve(is_sink.size());
  for (const Dag &dag : workload.dags) {
    for (std::size_t i = 0; i < dag.tasks.size(); ++i) {
      deadlines.push_back(is_sink[deadlines.size()] ? dag.deadline : Duration{0});
    }
  }
  return deadlines;
}

Miss miss_of(const JobRecord &job, Time end, Duration end_to_end) {
  if (is_lost(job)) return Miss::Lost;
  if (has_no_response(job)) return Miss::None;
  if (answered(job, end) > job.deadline) return Miss::Deadline;
  return is_late_end_to_end(job, end, end_to_end) ? Miss::EndToEnd : Miss::None;
}

}  // namespace redag::metrics
