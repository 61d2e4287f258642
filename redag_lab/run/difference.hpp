// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares two sides of runs row by row (each task, each DAG, all jobs) and says which figures differ by more than
// chance. Rows are matched by name. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag::lab {

/// A run is cut into this many stretches of time, or into fewer of at least two longest periods each.
inline constexpr Duration kStretches = 10;
/// The fewest runs of each side of which whole runs are compared; of fewer, their stretches are.
inline constexpr std::size_t kFewestRuns = 5;
/// The fewest stretches of each side that allow a test.
inline constexpr std::size_t kFewestStretches = 8;

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

  /// The jobs that were released in one stretch of a run, or in several.
  struct Jobs {
    std::uint64_t released = 0;
    std::uint64_t missed = 0;
    std::vector<Duration> responses;  // of the jobs that finished
  };

  struct Row {
    std::string dag;   // empty: all DAGs together
    std::string task;  // empty: the whole DAG
    metrics::JobCounts jobs;
    /// By run, then by stretch. Responses are f - r of a task, and f - origin of a DAG with one sink (end to end). All
    /// DAGs together have none, nor has a DAG with several sinks.
    std::vector<std::vector<Jobs>> runs;

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
    Duration stretch = 0;
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

struct FigureDifference {
  double a = 0;
  double b = 0;
  std::optional<double> p;  // two-sided; nothing: the data do not suffice for a test
  bool is_more = false;     // with p: B is larger rather than smaller
  Verdict verdict = Verdict::NotTested;
};

struct DifferenceRow {
  const DifferenceSide::Row *a = nullptr;
  const DifferenceSide::Row *b = nullptr;
  FigureDifference miss_ratio;
  std::array<FigureDifference, 3> responses;  // p50, p95, p99 in ns

  [[nodiscard]] bool is_any(Verdict verdict) const;
};

struct Difference {
  std::vector<DifferenceRow> rows;  // rows that both sides have, in the order of A
  bool of_runs = false;             // whole runs were compared, and not stretches of them

  [[nodiscard]] bool is_any(Verdict verdict) const;
};

/// Compares the sides. Misses come in bursts: a test that takes jobs for independent would find differences where there
/// are none. The samples are therefore the figures of whole runs or, of fewer than kFewestRuns, those of stretches that
/// are long against the periods (batch means: B. Schmeiser, Operations Research 30(3), 1982). Response percentiles that
/// differ by no more than the share `tolerance` of A's count as equal; one job of each sample has to be beyond the
/// percentile. The result refers to `a` and `b`. Requires at least one run on each side.
[[nodiscard]] Difference compare_sides(const DifferenceSide &a, const DifferenceSide &b, double tolerance);

/// Returns the one-sided p-value of "values of `b` tend to be larger than those of `a`", by the rank-sum test with the
/// normal approximation, corrected for ties and continuity (H. Mann, D. Whitney, Annals of Mathematical Statistics
/// 18(1), 1947).
[[nodiscard]] double p_larger(std::span<const double> a, std::span<const double> b);

/// Returns the largest of these p-values that is a discovery at a false discovery rate of `rate` (Y. Benjamini, Y.
/// Hochberg, Journal of the Royal Statistical Society B 57(1), 1995); 0 if none is.
[[nodiscard]] double discovery_threshold(std::vector<double> p_values, double rate = 0.05);

}  // namespace redag::lab
