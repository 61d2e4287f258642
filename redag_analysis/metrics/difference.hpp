// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Two sides of runs beside each other, row by row (each task, each DAG, all jobs): figures, intervals, and what is more
// than chance (block_bootstrap.hpp). Rows are matched by name. Parallel, the same answer for any number of processors.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/block_bootstrap.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

/// The runs of one side. All have the same tasks by name.
class DifferenceSide {
 public:
  /// Counts the jobs of one run. The first run says which tasks there are: requires the same ones of the others.
  void add(const trace::Trace &trace);

  [[nodiscard]] const std::vector<trace::RunInfo> &runs() const { return runs_; }

  struct Row {
    std::string dag;   // empty: of all DAGs together
    std::string task;  // empty: of the DAG
    std::uint64_t released = 0;
    std::uint64_t late = 0;
    std::uint64_t lost = 0;  // skipped, or aborted though they had data
    /// Of a task f - r, of a DAG with one sink f - origin there: end to end. 0 if none finished, and always of what has
    /// no response of its own: all DAGs together, a DAG with several sinks.
    Duration max = 0;
    BlockedRuns runs;  // with those responses

    [[nodiscard]] std::uint64_t missed() const { return late + lost; }
    [[nodiscard]] bool has_responses() const;
  };
  /// All jobs, then the DAGs, each followed by its tasks.
  [[nodiscard]] const std::vector<Row> &rows() const { return rows_; }

 private:
  struct Places {
    std::size_t dag = 0;
    std::size_t task = 0;
    std::optional<std::size_t> end_to_end;  // the row of its DAG, if it is the only sink
  };

  void make_rows(const Workload &workload);

  std::vector<trace::RunInfo> runs_;
  std::vector<Row> rows_;
  std::vector<Places> places_;  // rows of a task, by TaskId
};

enum class Verdict : std::uint8_t {
  Same,    // cannot be told apart
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
  std::vector<DifferenceRow> rows;   // of what both have, in the order of A
  std::vector<std::string> missing;  // rows that only one has
  std::size_t tests = 0;
  double threshold = 0;  // largest p-value that counts, of all tests together

  [[nodiscard]] bool is_any(Verdict verdict) const;
};

/// Refers to `a` and `b`. Requires a run on each side.
[[nodiscard]] Difference compare_sides(const DifferenceSide &a, const DifferenceSide &b,
                                       const BootstrapOptions &options);

}  // namespace redag::metrics
