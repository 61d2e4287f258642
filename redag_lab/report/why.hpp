// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces the explanations of a run's misses to what a report shows: all causes, and the parts of a bounded number of
// jobs. Pure but for the file of a run.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/why.hpp"
#include "redag_lab/report/schedule.hpp"

namespace redag::report {

/// A row of the list of the worst jobs.
struct WorstJob {
  metrics::JobRecord job;
  Time since = 0;                              // its release, from the start of the run
  std::optional<Duration> lateness;            // of the deadline that it missed most; empty: it was lost
  std::optional<metrics::Culprit> main_cause;  // empty: it was lost at its release
};

struct WhyDigest {
  std::uint64_t misses = 0;   // jobs that missed any deadline
  std::uint64_t missed = 0;   // of these, the late and lost ones; the others missed only the DAG's deadline
  std::size_t explained = 0;  // misses that the causes cover
  std::vector<metrics::Culprit> causes;
  std::vector<WorstJob> worst;             // all misses up to a limit, the worst first; without a miss the closest jobs
  std::vector<metrics::Explanation> jobs;  // the worst misses, and those that the schedule shows
};

/// Explains the misses of a run. Without a miss, the jobs are those that came closest to one. Error: a damaged file.
[[nodiscard]] Result<WhyDigest> why_of(const metrics::Investigation &investigation, const Schedule &schedule);

/// Returns the object `why` of a group (docs/results_format.md) as JSON.
[[nodiscard]] std::string to_json(const WhyDigest &why, const trace::RunInfo &run);

}  // namespace redag::report
