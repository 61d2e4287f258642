// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `sensitivity` says about margins of redag_lab/search: a table, words, JSON. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag_lab/cli/analyze/analysis_report.hpp"
#include "redag_lab/search/sensitivity.hpp"

namespace redag::cli {

struct KnobResult {
  analysis::Margin margin;
  std::optional<analysis::Margin> simulated;  // the same search, answered by the simulator
};

struct Sensitivity {
  Analysed analysed;
  std::vector<KnobResult> results;
  std::size_t knobs = 0;  // asked for; more than there are results where it was stopped
  std::uint32_t probes = 0;
  Duration simulated_for = 0;  // 0: not simulated
};

/// "wcet of slow.plan", "all wcets", "period of fast", "rates of fast", "all rates".
[[nodiscard]] std::string knob_name(const Analysed &analysed, const analysis::Knob &knob);

[[nodiscard]] std::string describe(const Sensitivity &sensitivity, const StreamTraits &terminal, bool all);

/// What the figures come to: how much room there is, or what has to shrink. Sentences, one a line.
[[nodiscard]] std::string in_words(const Sensitivity &sensitivity);

/// `redag.sensitivity/1`.
[[nodiscard]] Json to_json(const Sensitivity &sensitivity);

}  // namespace redag::cli
