// Follows the jobs of a stream of events and judges each against its deadlines when it ends, or when the run does: the
// one place that says what a miss is to those who need no summary. Judges by the workload alone. Not thread-safe.
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "redag/metrics/jobs.hpp"

namespace redag::metrics {

enum class Miss : std::uint8_t {
  None,
  Lost,      // skipped, or aborted though it had data
  Deadline,  // f - r above the task's deadline
  EndToEnd,  // in time itself, and f - origin above its DAG's end-to-end deadline
};

/// A job at its end; one that is still in flight when the run ends has answered after at least these.
struct JudgedJob {
  const JobRecord &record;
  std::optional<Duration> response;    // f - r; not of lost jobs
  std::optional<Duration> end_to_end;  // f - origin; not of lost jobs, nor of those that never carried data
  Miss miss = Miss::None;
};

class DeadlineWatch {
 public:
  explicit DeadlineWatch(const Workload &workload);

  /// Goes on where the last call stopped; calls see(const JudgedJob &) for each job that ended.
  template <class See>
  void add(std::span<const JobEvent> events, See &&see) {
    folder_.add(events);
    folder_.drain_ended([&](const JobRecord &record) { see(judge(record, record.finish)); });
  }

  /// The run is over: the same for the jobs in flight, in order of release.
  template <class See>
  void finish(Time end, See &&see) const {
    for (const JobRecord &record : folder_.in_flight()) see(judge(record, end));
  }

 private:
  struct Limits {
    Duration deadline = 0;
    Duration end_to_end = 0;  // 0: none
  };

  [[nodiscard]] JudgedJob judge(const JobRecord &record, Time until) const;

  std::vector<Limits> limits_;  // by TaskId
  JobFolder folder_;
};

}  // namespace redag::metrics
