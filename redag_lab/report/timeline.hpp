// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A run of any length at a glance. For each of a fixed number of equal stretches of time it holds each DAG's time on
// workers and its missed deadlines, and each device's time in use. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_lab/report/services.hpp"
#include "redag_lab/report/slices.hpp"

namespace redag::report {

struct Timeline {
  Time begin = 0;
  Duration bin = 1;  // length of a stretch; the last one can extend past the end of the run
  std::size_t bins = 0;
  std::vector<std::vector<Duration>> busy;           // by DagId, then by stretch: time on workers, over all workers
  std::vector<std::vector<Duration>> device_busy;    // by DeviceId, then by stretch: time of services, over all slots
  std::vector<std::vector<std::uint64_t>> released;  // jobs by the stretch of their release
  std::vector<std::vector<std::uint64_t>> missed;    // of these: late, overdue, skipped or aborted (not without data)
};

/// Makes a timeline of what a run consists of, in any order.
class TimelineBuilder {
 public:
  /// At most `most_bins` stretches of whole microseconds (or shorter ones, for very short runs). Requires
  /// most_bins > 0. `run` must outlive this object.
  TimelineBuilder(const trace::RunInfo &run, std::size_t most_bins);

  void add(const Slice &slice);
  void add(const Service &service);
  void add(const metrics::JobRecord &job);

  [[nodiscard]] Timeline take() { return std::move(timeline_); }

 private:
  [[nodiscard]] std::size_t bin_at(Time time) const;
  void fill(std::vector<Duration> &busy, Time begin, Time end) const;

  const trace::RunInfo &run_;
  Duration length_;
  std::vector<TaskRef> refs_;
  Timeline timeline_;
};

}  // namespace redag::report
