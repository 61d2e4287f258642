// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces runs to the data that a report shows, in several passes over their events. Everything that grows with a run's
// length is counted, sampled or cut: memory does not grow with it. Runs of one executor on one workload form a group,
// whose figures cover all its jobs. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/recording.hpp"
#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_analysis/metrics/check/check_report.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_lab/report/bounds.hpp"
#include "redag_lab/report/schedule.hpp"
#include "redag_lab/report/why.hpp"

namespace redag::report {

struct DigestOptions {
  std::size_t most_slices = 20'000;  // of the schedule, in all windows together
  std::size_t most_views = 6;
  std::size_t exact_jobs = metrics::kExactJobs;  // as of metrics::Summarizer
  std::size_t most_explained = 20'000;           // misses
};

struct RunDigest {
  std::string path;  // folder of the recorded run
  trace::RunInfo info;
  metrics::Summary summary;
  metrics::CheckReport check;
};

/// Figures of all jobs of all runs.
struct Group {
  std::string label;
  std::vector<RunDigest> runs;
  RunBounds bounds;
  std::size_t worst_run = 0;             // with most misses, or without any the job closest to its deadline
  Schedule schedule;                     // of that run
  WhyDigest why;                         // of that run
  std::vector<metrics::JobStats> tasks;  // by TaskId: counts and `response`
  std::vector<Duration> executions;      // by TaskId: the longest; processor time where the runs recorded it
  std::vector<metrics::DagSummary> dags;
  metrics::JobCounts total;
  metrics::AssumptionCheck assumptions;  // compares bounds and wcets with measurements, for runs on threads

  [[nodiscard]] const trace::RunInfo &info() const { return runs.front().info; }
  [[nodiscard]] const Workload &workload() const { return info().workload; }
  [[nodiscard]] bool is_simulated() const { return info().driver == trace::Driver::Simulator; }
};

class GroupReader {
 public:
  GroupReader(std::string label, const DigestOptions &options) : options_(options) { group_.label = std::move(label); }

  /// Adds a run. Requires fits(run.info()). Error: a damaged file; the group is then of no further use.
  [[nodiscard]] Result<void> add(const std::string &path, const trace::Recording &run);
  /// True if executor, mode and tasks are those of the group, whose jobs can then be counted together.
  [[nodiscard]] bool fits(const trace::RunInfo &info) const;
  /// Computes the figures of all runs together. Requires a run, and ends the use of this object.
  [[nodiscard]] Group finish();

 private:
  [[nodiscard]] Result<RunDigest> read(const std::string &path, const trace::Recording &run);
  [[nodiscard]] Result<void> explain(const trace::Recording &run);
  void sample(const metrics::JobRecord &job);
  [[nodiscard]] metrics::DagSummary pooled(DagId dag) const;

  DigestOptions options_;
  Group group_;
  std::vector<metrics::DurationSketch> responses_;   // by TaskId: f - r
  std::vector<metrics::DurationSketch> end_to_end_;  // by TaskId: f - origin, of sinks
  std::vector<bool> is_sink_;                        // by TaskId
  std::pair<std::uint64_t, double> worst_{};         // misses of the worst run, and how close a job came to one
};

}  // namespace redag::report
