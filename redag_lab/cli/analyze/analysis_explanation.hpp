// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Itemises a response time in words, for `analyze --explain`. Pure functions.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag_lab/cli/analyze/analysis_report.hpp"

namespace redag::cli {

/// The file that states a workload.
struct SourceText {
  std::string file;
  std::string text;
  std::vector<DagId> dags;  // by DagId of the analysis: the DAG in the file
};

/// Finds a row by `name`: "dag.task" (or "dag/task"), or a DAG's name. Error, with the nearest name, if there is no
/// such task or DAG.
[[nodiscard]] Result<lab::Row> find_row(const lab::Analysed &analysed, const std::string &name);

/// Returns the terms of the bound, largest share first, and a suggested change; or the reason why there is no bound.
/// Where a deadline is not shown to be met, it names the key that is in the way. Without
/// `source` it names no line.
[[nodiscard]] std::string explain(const lab::Analysed &analysed, const lab::Row &row, const StreamTraits &terminal,
                                  const SourceText &source = {});

}  // namespace redag::cli
