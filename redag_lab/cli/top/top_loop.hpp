// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `redag top` on a terminal: looks at the pages, draws, and waits for keys, until the user quits. One thread.
#pragma once

#include <optional>
#include <string>

#include "redag/base/time.hpp"
#include "redag_lab/cli/top/attachment.hpp"
#include "redag_lab/cli/top/live_figures.hpp"
#include "redag_lab/cli/top/live_graphs.hpp"

namespace redag::cli {

struct TopOptions {
  std::string folder;
  Duration interval = kSecond;
  std::optional<LiveTarget> target;
  LiveView view;
  Glyphs glyphs;
  bool colour = true;
};

/// Returns the exit status.
[[nodiscard]] int run_top(const TopOptions &options);
/// The tasks of all executors in one table, until the user quits. Returns the exit status.
[[nodiscard]] int watch_machine(const TopOptions &options);

}  // namespace redag::cli
