// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The verdict on a run's deadlines in one set of words: `run`, `simulate`, `report` and its page say the same. Pure
// functions.
#pragma once

#include <span>
#include <string>

#include "redag_analysis/metrics/summary.hpp"

namespace redag::metrics {

struct DeadlineVerdict {
  bool is_judged = false;  // false: no job was released
  bool is_met = false;     // no job was late or lost, and no DAG exceeded its end-to-end deadline
  std::string headline;    // "1 of 23 326 jobs missed their deadline (0.0043 %)"
  std::string text;        // begins with the headline: "...: 1 late. By DAG: ...", with a period
};

/// Judges one run, or several whose counts were added.
[[nodiscard]] DeadlineVerdict deadline_verdict(const JobCounts &total, std::span<const DagSummary> dags);

/// True if any deadline was missed, end-to-end deadlines included.
[[nodiscard]] bool has_misses(const JobCounts &total, std::span<const DagSummary> dags);

}  // namespace redag::metrics
