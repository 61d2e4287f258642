// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Follows the jobs of a stream of events and judges each (miss.hpp) when it or the run ends, for callers that need no
// summary. Not thread-safe.
#pragma once

#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::metrics {

/// A job at its end. For a job that is in flight when the run ends, the response times are lower bounds.
struct JudgedJob {
  const JobRecord &record;
  std::optional<Duration> response;    // f - r; empty for lost jobs
  std::optional<Duration> end_to_end;  // f - origin of a sink; empty if lost or without data
  Miss miss = Miss::None;
};

class DeadlineWatch {
 public:
  explicit DeadlineWatch(const Workload &workload);

  /// Continues from the last call, and calls see(const JudgedJob &) for each job that ended.
  template <class See>
  void add(std::span<const JobEvent> events, See &&see) {
    folder_.add(events);
    folder_.drain_ended([&](const JobRecord &record) { see(judge(record, record.finish)); });
  }

  /// Ends the run: judges the jobs in flight, in order of release.
  template <class See>
  void finish(Time end, See &&see) const {
    for (const JobRecord &record : folder_.in_flight()) see(judge(record, end));
  }

 private:
  [[nodiscard]] JudgedJob judge(const JobRecord &record, Time until) const;

  std::vector<bool> is_sink_;         // by TaskId
  std::vector<Duration> end_to_end_;  // by TaskId: the deadline of its DAG; 0: none
  JobFolder folder_;
};

}  // namespace redag::metrics
