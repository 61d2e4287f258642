// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/paper_accounting.hpp"

#include <algorithm>
#include <vector>

namespace redag::metrics {

PaperCount paper_count(const Workload &workload, std::span<const JobRecord> records, Duration startup,
                       std::optional<DagId> dag) {
  const std::vector<TaskRef> refs = flatten(workload);
  std::vector<std::int64_t> ran(refs.size(), 0);
  std::vector<Time> epoch(refs.size(), kNever);
  PaperCount count;
  for (const JobRecord &job : records) {
    const TaskRef &ref = refs[job.task.value];
    Time &first = epoch[job.task.value];
    if (first == kNever) first = job.release - startup;
    if (ref.task->activation != Activation::Timer || job.outcome != JobOutcome::Finished) continue;
    if (dag && ref.dag != *dag) continue;
    const Time nominal = first + ran[job.task.value]++ * ref.task->period;
    const Duration lateness = job.finish - (nominal + ref.task->deadline);
    ++count.jobs;
    if (lateness > 0) ++count.late;
    count.max_lateness = std::max(count.max_lateness.value_or(lateness), lateness);
  }
  return count;
}

}  // namespace redag::metrics
