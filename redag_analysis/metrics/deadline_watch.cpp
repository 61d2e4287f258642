// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/deadline_watch.hpp"

namespace redag::metrics {

DeadlineWatch::DeadlineWatch(const Workload &workload)
    : is_sink_(sinks_of(workload)), end_to_end_(end_to_end_deadlines(workload)), folder_(workload) {}

JudgedJob DeadlineWatch::judge(const JobRecord &record, Time until) const {
  const std::size_t task = record.task.value;
  JudgedJob judged{record, std::nullopt, std::nullopt, miss_of(record, until, end_to_end_[task])};
  if (has_no_response(record)) return judged;
  judged.response = until - record.release;
  if (is_sink_[task] && record.origin != kNever) judged.end_to_end = until - record.origin;
  return judged;
}

}  // namespace redag::metrics
