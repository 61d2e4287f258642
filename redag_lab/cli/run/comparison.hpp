// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Sessions of several executors on the same jobs, put side by side: counts and maxima of all repetitions together,
// percentiles as medians over repetitions with their spread, and a verdict in words. Pure values and functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag_lab/cli/run/session.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/cli/terminal/variant.hpp"
#include "redag_lab/report/verdict.hpp"

namespace redag::cli {

/// One DAG in one session; times in ns. "total" is all DAGs together.
struct Observation {
  metrics::JobCounts jobs;
  metrics::EndToEnd end_to_end;  // nothing of the total
};

using report::Spread;

struct ExecutorResults {
  Variant variant;
  std::string preemption;                             // mode that ran
  std::string preemption_why;                         // of the last repetition
  std::vector<std::vector<Observation>> repetitions;  // [repetition][DAG]; the last DAG is the total
  bool realtime = false;                              // on SCHED_FIFO threads
  std::uint64_t check_violations = 0;
  std::vector<std::string> warnings;  // each once

  void add(const Session &session);
  /// Share of a repetition's jobs that missed, over the repetitions.
  [[nodiscard]] Spread miss(std::size_t dag) const;
  /// The same of those that were late.
  [[nodiscard]] Spread late(std::size_t dag) const;
  /// A percentile of the end-to-end response over the repetitions in which the DAG answered; nothing if in none.
  [[nodiscard]] std::optional<Spread> end_to_end(std::size_t dag, Duration metrics::Distribution::*percentile) const;
  /// The largest end-to-end response of all repetitions; nothing if there was none.
  [[nodiscard]] std::optional<Duration> longest_end_to_end(std::size_t dag) const;
  [[nodiscard]] std::uint64_t late_end_to_end(std::size_t dag) const;
  /// Of all repetitions.
  [[nodiscard]] metrics::JobCounts jobs(std::size_t dag) const;
  /// Was a deadline missed in any repetition, end-to-end deadlines included?
  [[nodiscard]] bool has_misses() const;
};

struct Comparison {
  std::string workload;
  std::vector<std::string> dags;  // the last is "total"
  trace::Driver driver = trace::Driver::Threads;
  Duration duration = 0;
  std::uint64_t seed = 1;
  std::uint32_t workers = 1;
  std::vector<ExecutorResults> executors;  // each with a repetition at least
  std::vector<std::string> warnings;       // about all of it
};

/// "control: redag misses none, mte 14.2 %, ste 30.1 %: redag misses fewest"
[[nodiscard]] std::vector<std::string> verdicts(const Comparison &comparison);

/// What makes the comparison less than fair: some executors had real-time threads and others had not. Empty if nothing.
[[nodiscard]] std::string caveat(const Comparison &comparison);

[[nodiscard]] std::string describe(const Comparison &comparison, const StreamTraits &terminal);
[[nodiscard]] Json to_json(const Comparison &comparison);
/// A row per executor, DAG and repetition.
[[nodiscard]] std::string to_csv(const Comparison &comparison);

}  // namespace redag::cli
