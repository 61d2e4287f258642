// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Cause-effect chains of `analyze --chain`: reaction time and data age end to end, also over several DAGs. Pure
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
  /// The exact reaction time and age under logical execution time (read at the release, write at the deadline), if all
  /// tasks are timers.
  std::optional<Duration> let;
};

/// Returns the parts of "dag.task,dag.task,...".
[[nodiscard]] std::vector<std::string> names_in(const std::string &chain);

/// Bounds the chain "dag.task,dag.task,..." with the tightest bounds of the tasks and DAGs. Error: malformed, or a name
/// without a task.
[[nodiscard]] Result<ChainRow> find_chain(const lab::Analysed &analysed, const std::string &chain);

/// Returns a table, the segments of each chain, and an explanation of the figures.
[[nodiscard]] std::string describe(const lab::Analysed &analysed, const std::vector<ChainRow> &chains,
                                   const StreamTraits &terminal);

[[nodiscard]] Json to_json(const lab::Analysed &analysed, const std::vector<ChainRow> &chains);

}  // namespace redag::cli
