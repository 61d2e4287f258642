#include "redag/metrics/paper_accounting.hpp"

#include <algorithm>
#include <vector>

namespace redag::metrics {

PaperCount paper_count(const Workload &workload, std::span<const JobRecord> records, Time epoch,
                       std::optional<DagId> dag) {
  const std::vector<TaskRef> refs = flatten(workload);
  std::vector<std::int64_t> ran(refs.size(), 0);
  PaperCount count;
  for (const JobRecord &job : records) {
    const TaskRef &ref = refs[job.task.value];
    if (ref.task->activation != Activation::Timer || job.outcome != JobOutcome::Finished) continue;
    if (dag && ref.dag != *dag) continue;
    const Time nominal = epoch + ref.task->offset + ran[job.task.value]++ * ref.task->period;
    const Duration lateness = job.finish - (nominal + ref.task->deadline);
    ++count.jobs;
    if (lateness > 0) ++count.late;
    count.max_lateness = std::max(count.max_lateness.value_or(lateness), lateness);
  }
  return count;
}

}  // namespace redag::metrics
