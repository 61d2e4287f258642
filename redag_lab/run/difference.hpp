// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares two sides of runs row by row (each task, each DAG, all jobs): figures, intervals, and which differences
// exceed chance (block_bootstrap.hpp). Rows are matched by name. Runs in parallel; the answer is the same for any
// number of processors.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_lab/run/block_bootstrap.hpp"

namespace redag::lab {

/// The runs of one side. All runs have the same task names.
class DifferenceSide {
 public:
  /// Counts the jobs of one run, whose events are given by add_events() until end_run(). The first run determines the
  /// tasks; all other runs must have the same ones.
  void begin_run(const trace::RunInfo &run);
  void add_events(std::span<const JobEvent> events);
  void end_run();
  /// The three of a whole trace.
  void add(const trace::Trace &trace);

  [[nodiscard]] const std::vector<trace::RunInfo> &runs() const { return runs_; }

  struct Row {
    std::string dag;   // empty: all DAGs together
    std::string task;  // empty: the whole DAG
    metrics::JobCounts jobs;
    /// For a task the largest f - r; for a DAG with one sink the largest f - origin there (end to end). It is 0 if none
    /// finished, and for rows without a response of their own: all DAGs together, or a DAG with several sinks.
    Duration max = 0;
    BlockedRuns runs;  // with the responses that `max` refers to

    [[nodiscard]] bool has_responses() const;
  };
  /// All jobs, then the DAGs, each followed by its tasks.
  [[nodiscard]] const std::vector<Row> &rows() const { return rows_; }

 private:
  struct Places {
    std::size_t dag = 0;
    std::size_t task = 0;
    std::optional<std::size_t> end_to_end;  // the row of its DAG, if the task is its only sink
  };

  // What is known of the run that is being counted.
  struct Counting {
    metrics::JobFolder folder;
    Time begin = 0;
    Duration block = 0;
  };

  void make_rows(const Workload &workload);
  void count(const metrics::JobRecord &job);

  std::vector<trace::RunInfo> runs_;
  std::vector<Row> rows_;
  std::vector<Places> places_;  // rows of a task, by TaskId
  std::optional<Counting> counting_;
};

enum class Verdict : std::uint8_t {
  Same,    // indistinguishable
  Better,  // B misses less, or is faster
  Worse,
  NotTested,  // too few jobs, or too short runs
};

[[nodiscard]] const char *to_string(Verdict verdict);

struct DifferenceRow {
  const DifferenceSide::Row *a = nullptr;
  const DifferenceSide::Row *b = nullptr;
  RowDifference figures;
  Verdict miss = Verdict::NotTested;
  Verdict p50 = Verdict::NotTested;
  Verdict p95 = Verdict::NotTested;
  Verdict p99 = Verdict::NotTested;

  [[nodiscard]] bool is_any(Verdict verdict) const {
    return miss == verdict || p50 == verdict || p95 == verdict || p99 == verdict;
  }
  [[nodiscard]] bool is_correlated() const { return figures.block_correlation > figures.correlation_limit; }
};

struct Difference {
  std::vector<DifferenceRow> rows;   // rows that both sides have, in the order of A
  std::vector<std::string> missing;  // rows that only one side has
  std::size_t tests = 0;
  double threshold = 0;  // the largest p-value that counts, over all tests together

  [[nodiscard]] bool is_any(Verdict verdict) const;
};

/// Compares the sides. The result refers to `a` and `b`. Requires at least one run on each side.
[[nodiscard]] Difference compare_sides(const DifferenceSide &a, const DifferenceSide &b,
                                       const BootstrapOptions &options);

}  // namespace redag::lab
