// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The tables of `redag top`. Pure functions.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag_analysis/text/table.hpp"
#include "redag_lab/cli/top/live_figures.hpp"

namespace redag::cli {

/// Returns "1234", or "1234.1" for a second executor of a process.
[[nodiscard]] std::string id_of(const live::Listed &listed);

/// Returns the rows of the pages that `view` shows, with their executors if it shows all.
[[nodiscard]] Table task_table(std::span<const live::Listed> pages, const LiveView &view);

/// Returns one row per executor.
[[nodiscard]] Table executor_table(const std::vector<live::Listed> &pages, Time now);

}  // namespace redag::cli
