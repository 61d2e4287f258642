// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares sessions of several executors on the same jobs. Counts and maxima cover all repetitions. Percentiles are
// medians over repetitions with their spread. A verdict in words follows. Pure values and functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag_lab/report/verdict.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"

namespace redag::lab {

using report::Spread;

struct ExecutorResults {
  Variant variant;
  std::string preemption;                                     // the mode that ran
  std::string preemption_why;                                 // of the last repetition
  std::vector<std::vector<metrics::DagSummary>> repetitions;  // [repetition][DAG]; the last is the total, only counted
  bool realtime = false;                                      // on SCHED_FIFO threads
  std::uint64_t check_violations = 0;
  std::vector<std::string> warnings;  // each listed once

  void add(const Session &session);
  /// Returns the share of a repetition's jobs that missed, as a spread over the repetitions.
  [[nodiscard]] Spread miss(std::size_t dag) const;
  /// Returns the share of a repetition's jobs that were late, likewise.
  [[nodiscard]] Spread late(std::size_t dag) const;
  /// Returns a percentile of the end-to-end response over the repetitions in which the DAG answered; nothing if there
  /// is none.
  [[nodiscard]] std::optional<Spread> end_to_end(std::size_t dag, Duration metrics::Distribution::*percentile) const;
  /// Returns the largest end-to-end response of all repetitions; nothing if there was none.
  [[nodiscard]] std::optional<Duration> longest_end_to_end(std::size_t dag) const;
  [[nodiscard]] std::uint64_t late_end_to_end(std::size_t dag) const;
  /// Returns the counts of all repetitions.
  [[nodiscard]] metrics::JobCounts jobs(std::size_t dag) const;
  /// True if any repetition missed a deadline, including end-to-end deadlines.
  [[nodiscard]] bool has_misses() const;
};

struct Comparison {
  std::string workload;
  std::vector<std::string> dags;  // the last is "total"
  trace::Driver driver = trace::Driver::Threads;
  Duration duration = 0;
  std::uint64_t seed = 1;
  std::uint32_t workers = 1;
  std::vector<ExecutorResults> executors;  // each with at least one repetition
  std::vector<std::string> warnings;       // about the whole comparison
};

}  // namespace redag::lab
