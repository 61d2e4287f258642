// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The tasks of all running executors in one table, most urgent first: the one order that the kernel schedules. Pure
// functions.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"
#include "redag_lab/cli/top/live_figures.hpp"

namespace redag::cli {

/// A task of one of the pages.
struct MachineRow {
  std::size_t page = 0;
  std::size_t task = 0;  // among the page's tasks

  friend bool operator==(const MachineRow &, const MachineRow &) = default;
};

/// Returns the tasks that `view` does not filter out: by priority, then by period, tasks without a priority of their
/// own last. Ignores the view's own order.
[[nodiscard]] std::vector<MachineRow> machine_rows(const std::vector<live::Listed> &pages, const LiveView &view);

/// `width` is in columns; 0: no limit.
[[nodiscard]] std::string machine_text(const std::vector<live::Listed> &pages, const LiveView &view, std::size_t width,
                                       bool colour);

}  // namespace redag::cli
