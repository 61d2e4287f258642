// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reduces the explanations of a run's misses to what a report shows: all causes, and the parts of a bounded number of
// jobs. Pure but for the file of a run.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/why/why.hpp"

namespace redag::report {

struct WhyDigest {
  std::uint64_t misses = 0;   // jobs that missed any deadline
  std::uint64_t missed = 0;   // of these, the late and lost ones; the others missed only the DAG's deadline
  std::size_t explained = 0;  // misses that the causes cover
  std::vector<metrics::Culprit> causes;
  std::vector<metrics::Explanation> worst;       // the worst misses; without one the jobs that came closest
  std::vector<metrics::JobRecord> worst_of_dag;  // the worst job of each DAG, the worst first
};

/// Explains the misses of a run, and finds the worst jobs of at most `most_dags` DAGs. Error: a damaged file.
[[nodiscard]] Result<WhyDigest> why_of(const metrics::Investigation &investigation, std::size_t most_dags);

/// Returns the object `why` of a group (docs/results_format.md).
[[nodiscard]] nlohmann::ordered_json to_json(const WhyDigest &why, const trace::RunInfo &run);

}  // namespace redag::report
