// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents the margins of redag_lab/search for `sensitivity`: a table, words, JSON. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag_lab/cli/analyze/analysis_report.hpp"
#include "redag_lab/search/sensitivity.hpp"

namespace redag::cli {

struct KnobResult {
  lab::Margin margin;
  std::optional<lab::Margin> simulated;  // the same search, judged by the simulator
};

struct Sensitivity {
  lab::Analysed analysed;
  std::vector<KnobResult> results;
  std::size_t knobs = 0;  // requested; more than `results` if the search was stopped
  std::uint32_t probes = 0;
  Duration simulated_for = 0;  // 0: not simulated
};

/// Returns "wcet of slow.plan", "all wcets", "period of fast", "rates of fast" or "all rates".
[[nodiscard]] std::string knob_name(const lab::Analysed &analysed, const lab::Knob &knob);

[[nodiscard]] std::string describe(const Sensitivity &sensitivity, const StreamTraits &terminal, bool all);

/// Summarises the margins: how much can grow, or what has to shrink. Sentences, one per line.
[[nodiscard]] std::string in_words(const Sensitivity &sensitivity);

/// Returns `redag.sensitivity/1`.
[[nodiscard]] Json to_json(const Sensitivity &sensitivity);

}  // namespace redag::cli
