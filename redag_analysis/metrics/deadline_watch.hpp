// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Follows the jobs of a stream of events and judges each (miss.hpp) when it ends, or when the run does: for callers
// that need no summary. Not thread-safe.
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::metrics {

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
  [[nodiscard]] JudgedJob judge(const JobRecord &record, Time until) const;

  std::vector<Duration> end_to_end_;  // by TaskId: the DAG's deadline; 0: none
  JobFolder folder_;
};

}  // namespace redag::metrics
