// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Cause-effect chains that `analyze --chain` asks for: reaction and age end to end, also over several DAGs. Pure
// functions.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "redag_analysis/analyze/chains.hpp"
#include "redag_lab/cli/analyze/analysis_report.hpp"

namespace redag::cli {

struct ChainRow {
  std::vector<TaskId> tasks;  // in the order of the data
  std::variant<analysis::NotApplicable, analysis::ChainBound> bound;
  /// Under logical execution time, reading at the release and writing at the deadline: exact, where all are timers.
  std::optional<Duration> let;
};

/// `chain`: "dag.task,dag.task,...". By the tightest bounds of the tasks and DAGs. Error: a name that is none, or no
/// task's.
[[nodiscard]] Result<ChainRow> find_chain(const Analysed &analysed, const std::string &chain);

/// A table, the segments of each chain, and what the figures mean.
[[nodiscard]] std::string describe(const Analysed &analysed, const std::vector<ChainRow> &chains,
                                   const StreamTraits &terminal);

[[nodiscard]] Json to_json(const Analysed &analysed, const std::vector<ChainRow> &chains);

}  // namespace redag::cli
