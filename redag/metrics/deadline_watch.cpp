#include "redag/metrics/deadline_watch.hpp"

namespace redag::metrics {

DeadlineWatch::DeadlineWatch(const Workload &workload) : folder_(workload) {
  limits_.reserve(workload.task_count());
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) limits_.push_back(Limits{task.deadline, dag.deadline});
  }
}

JudgedJob DeadlineWatch::judge(const JobRecord &record, Time until) const {
  JudgedJob judged{record, std::nullopt, std::nullopt, Miss::None};
  if (record.outcome == JobOutcome::Skipped || record.outcome == JobOutcome::Aborted) {
    if (record.reason != Reason::NoData) judged.miss = Miss::Lost;
    return judged;
  }
  const Limits &limits = limits_[record.task.value];
  judged.response = until - record.release;
  if (record.origin != kNever) judged.end_to_end = until - record.origin;
  if (*judged.response > limits.deadline) {
    judged.miss = Miss::Deadline;
  } else if (limits.end_to_end > 0 && judged.end_to_end && *judged.end_to_end > limits.end_to_end) {
    judged.miss = Miss::EndToEnd;
  }
  return judged;
}

}  // namespace redag::metrics
