// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/deadline_watch.hpp"

namespace redag::metrics {

DeadlineWatch::DeadlineWatch(const Workload &workload) : folder_(workload) {
  end_to_end_.reserve(workload.task_count());
  for (const Dag &dag : workload.dags) end_to_end_.insert(end_to_end_.end(), dag.tasks.size(), dag.deadline);
}

JudgedJob DeadlineWatch::judge(const JobRecord &record, Time until) const {
  JudgedJob judged{record, std::nullopt, std::nullopt, miss_of(record, until, end_to_end_[record.task.value])};
  if (has_no_response(record)) return judged;
  judged.response = until - record.release;
  if (record.origin != kNever) judged.end_to_end = until - record.origin;
  return judged;
}

}  // namespace redag::metrics
