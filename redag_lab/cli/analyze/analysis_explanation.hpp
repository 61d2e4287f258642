// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Where a response time comes from, in words: what `analyze --explain` prints. Pure functions.
#pragma once

#include <optional>
#include <string>

#include "redag_lab/cli/analyze/analysis_report.hpp"

namespace redag::cli {

/// `name` is "dag.task" ("dag/task" too) or a DAG's. Error, with the nearest name, if there is no such task or DAG.
[[nodiscard]] Result<Row> find_row(const Analysed &analysed, const std::string &name);

/// The terms of the bound, largest share first, and what to change; or why there is none.
[[nodiscard]] std::string explain(const Analysed &analysed, const Row &row, const StreamTraits &terminal);

}  // namespace redag::cli
