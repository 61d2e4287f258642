// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces the explanations of a run's misses to what a report shows: all causes, and the parts of a bounded number of
// jobs. Pure functions.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/why.hpp"
#include "redag_lab/report/schedule.hpp"

namespace redag::report {

struct WhyDigest {
  std::size_t misses = 0;
  std::size_t explained = 0;  // misses that the causes cover
  std::vector<metrics::Culprit> causes;
  std::vector<metrics::Explanation> jobs;  // the worst misses, and those that the schedule shows
};

/// Explains a run. Without a miss, the jobs are those that came closest to one. `kernel` is null if there is no record.
[[nodiscard]] WhyDigest why_of(const trace::Trace &trace, const metrics::KernelRecord *kernel,
                               const Schedule &schedule);

/// Returns the object `why` of a group (docs/results_format.md) as JSON.
[[nodiscard]] std::string to_json(const WhyDigest &why, const Workload &workload);

}  // namespace redag::report
