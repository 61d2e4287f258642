// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents explanations (redag_analysis/metrics/why/why.hpp) on the terminal and as JSON. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "redag_analysis/metrics/why/why.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"

namespace redag::cli {

/// The explanations of a whole run: of its misses, or without any of the jobs closest to their deadlines.
struct WhyOverview {
  std::vector<metrics::Explanation> explanations{};  // to be shown; the worst first
  std::vector<metrics::Culprit> causes{};            // of all that were explained
  std::size_t explained = 0;
  std::uint64_t missed = 0;           // late or lost
  std::uint64_t late_end_to_end = 0;  // others, which missed only the end-to-end deadline of their DAG
  std::uint64_t jobs = 0;             // released, those of the warm-up left out

  /// In all; not all need to be explained.
  [[nodiscard]] std::uint64_t misses() const { return missed + late_end_to_end; }
};

/// Returns one job's parts in `most` lines (0: one for each part), and what they sum to.
[[nodiscard]] std::string describe(const metrics::Explanation &explanation, const trace::RunInfo &run,
                                   const StreamTraits &terminal, std::size_t most);

/// Returns the causes of a whole run and a table of its misses.
[[nodiscard]] std::string describe(const WhyOverview &overview, const trace::RunInfo &run,
                                   const StreamTraits &terminal);

/// Returns the document "redag.why/1" (docs/why.md), with at most `most` parts of each job (0: all).
[[nodiscard]] Json to_json(const WhyOverview &overview, const trace::RunInfo &run, std::size_t most);

}  // namespace redag::cli
