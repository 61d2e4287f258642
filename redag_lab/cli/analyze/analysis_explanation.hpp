// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Itemises a response time in words, for `analyze --explain`. Pure functions.
#pragma once

#include <optional>
#include <string>

#include "redag_lab/cli/analyze/analysis_report.hpp"

namespace redag::cli {

/// Finds a row by `name`: "dag.task" (or "dag/task"), or a DAG's name. Error, with the nearest name, if there is no
/// such task or DAG.
[[nodiscard]] Result<lab::Row> find_row(const lab::Analysed &analysed, const std::string &name);

/// Returns the terms of the bound, largest share first, and a suggested change; or the reason why there is no bound.
[[nodiscard]] std::string explain(const lab::Analysed &analysed, const lab::Row &row, const StreamTraits &terminal);

}  // namespace redag::cli
