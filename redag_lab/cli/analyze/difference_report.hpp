// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `diff` says about two sides: a table, what is more than chance in words, and what to beware of. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag_analysis/metrics/difference.hpp"
#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/cli/terminal/json.hpp"
#include "redag_lab/workload/changes.hpp"

namespace redag::cli {

/// One of the two places.
struct DiffSide {
  std::string name;
  metrics::DifferenceSide jobs;
};

struct Diffed {
  DiffSide a;
  DiffSide b;
  std::vector<Change> changes;  // of the workloads
  metrics::Difference difference;
  metrics::BootstrapOptions options;
  std::vector<std::string> warnings;
};

/// What makes the figures of two sides less comparable than they look, whatever they are.
[[nodiscard]] std::vector<std::string> caveats(const DiffSide &a, const DiffSide &b);

/// `all`: a row for every task, not only for those with a difference.
[[nodiscard]] std::string describe(const Diffed &diffed, const StreamTraits &terminal, bool all);

/// `redag.difference/2`.
[[nodiscard]] Json to_json(const Diffed &diffed);

}  // namespace redag::cli
