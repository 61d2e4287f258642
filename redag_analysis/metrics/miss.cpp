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

Miss miss_of(const JobRecord &job, Time end, Duration end_to_end) {
  if (is_lost(job)) return Miss::Lost;
  if (has_no_response(job)) return Miss::None;
  if (answered(job, end) > job.deadline) return Miss::Deadline;
  return is_late_end_to_end(job, end, end_to_end) ? Miss::EndToEnd : Miss::None;
}

}  // namespace redag::metrics
