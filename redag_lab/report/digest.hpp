// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces runs to the data that a report shows, in several passes over their events. Everything that grows with a run's
// length is counted, sampled or cut: memory does not grow with it. Runs of one executor on one workload form a group,
// whose figures cover all its jobs. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/recording.hpp"
#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_analysis/metrics/check_report.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_lab/report/bounds.hpp"
#include "redag_lab/report/curves.hpp"
#include "redag_lab/report/schedule.hpp"
#include "redag_lab/report/timeline.hpp"
#include "redag_lab/report/why.hpp"

namespace redag::report {

struct DigestOptions {
  std::size_t most_slices = 20'000;  // of the schedule, in all windows together
  std::size_t most_views = 6;
  std::size_t most_bins = 400;
  std::size_t exact_jobs = metrics::kExactJobs;  // as of metrics::Summarizer
  std::size_t most_explained = 20'000;           // misses
};

/// What the finished jobs of a task were like.
struct Samples {
  std::vector<CurvePoint> responses;  // f - r
  bool is_exact = true;               // `responses`, and the percentiles
  LatenessHistogram lateness;
  Duration execution_max = 0;  // largest processor time; time on a worker where the run did not record it
};

struct RunDigest {
  std::string path;  // folder of the recorded run
  trace::RunInfo info;
  metrics::Summary summary;
  metrics::CheckReport check;
};

/// The job with the largest lateness relative to its deadline.
struct LatestJob {
  metrics::JobRecord record;
  std::size_t run = 0;  // the number of its run in the group
};

class Group {
 public:
  /// Starts without runs. Call add() before any other function.
  Group(std::string label, const DigestOptions &options) : label_(std::move(label)), options_(options) {}

  /// Adds a run. The worst run provides the schedule, the timeline and the explanations. Requires fits(run.info()).
  /// Error: a damaged file; the group is then of no further use.
  [[nodiscard]] Result<void> add(const std::string &path, const trace::Recording &run);
  /// True if executor, mode and tasks are those of the group, whose jobs can then be counted together.
  [[nodiscard]] bool fits(const trace::RunInfo &info) const;
  /// Sorts, and computes the figures of all runs together. Call it after the last add().
  void finish();

  [[nodiscard]] const std::string &label() const { return label_; }
  void set_label(std::string label) { label_ = std::move(label); }
  [[nodiscard]] const std::vector<RunDigest> &runs() const { return runs_; }
  [[nodiscard]] const trace::RunInfo &info() const { return runs_.front().info; }
  [[nodiscard]] const Workload &workload() const { return info().workload; }
  [[nodiscard]] const RunBounds &bounds() const { return bounds_; }
  /// The position of the run with most misses, or without any the job closest to its deadline. schedule(), timeline()
  /// and why() are of it.
  [[nodiscard]] std::size_t worst_run() const { return worst_run_; }
  [[nodiscard]] const Schedule &schedule() const { return schedule_; }
  [[nodiscard]] const WhyDigest &why() const { return why_; }
  [[nodiscard]] const Timeline &timeline() const { return timeline_; }
  [[nodiscard]] const std::optional<LatestJob> &latest() const { return latest_; }

  // Figures of all jobs of all runs: counts and, of a task's distributions, only `response` and `split`.
  [[nodiscard]] const metrics::JobStats &task(TaskId task) const { return task_stats_[task.value]; }
  [[nodiscard]] const std::vector<metrics::DagSummary> &dags() const { return dags_; }
  [[nodiscard]] const metrics::JobCounts &dag(DagId dag) const { return dags_[dag.value].jobs; }
  [[nodiscard]] const metrics::JobCounts &total() const { return total_; }
  [[nodiscard]] const metrics::EndToEnd &end_to_end(DagId dag) const { return dags_[dag.value].end_to_end; }
  [[nodiscard]] const Samples &samples(TaskId task) const { return samples_[task.value]; }
  /// Compares bounds and wcets with measurements, for runs on threads, over all runs.
  [[nodiscard]] const metrics::AssumptionCheck &assumptions() const { return assumptions_; }

 private:
  [[nodiscard]] metrics::DagSummary pooled(DagId dag);
  void begin(const trace::RunInfo &info);
  [[nodiscard]] Result<RunDigest> read(const std::string &path, const trace::Recording &run, Timeline &timeline);
  [[nodiscard]] bool is_worst(const metrics::Investigation &investigation) const;
  void take(const trace::RunInfo &info, const metrics::JobRecord &job);

  std::string label_;
  DigestOptions options_;
  std::vector<RunDigest> runs_;
  std::vector<bool> is_sink_;                        // by TaskId
  std::vector<Samples> samples_;                     // by TaskId; `responses` once the group is finished
  std::vector<metrics::DurationSketch> responses_;   // by TaskId: f - r, until then
  std::vector<metrics::DurationSketch> end_to_end_;  // by TaskId: f - origin, of sinks
  std::optional<LatestJob> latest_;
  RunBounds bounds_;
  std::size_t worst_run_ = 0;
  std::uint64_t most_missed_ = 0;  // jobs of that run
  Schedule schedule_;
  WhyDigest why_;
  Timeline timeline_;
  std::vector<metrics::JobStats> task_stats_;
  std::vector<metrics::DagSummary> dags_;
  metrics::JobCounts total_;
  metrics::AssumptionCheck assumptions_;
};

}  // namespace redag::report
