// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Presents a comparison of two recorded results: a table, the significant differences in words, and cautions. Pure
// functions.
#pragma once

#include <string>
#include <vector>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/run/difference.hpp"
#include "redag_lab/workload/changes.hpp"

namespace redag::cli {

/// One of the two compared places.
struct DiffSide {
  std::string name;
  lab::DifferenceSide jobs;
};

struct Diffed {
  DiffSide a;
  DiffSide b;
  std::vector<lab::Change> changes;  // between the workloads
  lab::Difference difference;
  double tolerance = 0.05;  // of compare_sides()
  std::vector<std::string> warnings;
};

/// Returns reasons why the two sides are less comparable than they look, regardless of the figures.
[[nodiscard]] std::vector<std::string> caveats(const DiffSide &a, const DiffSide &b);

/// `all`: a row for every task, not only for those with a difference.
[[nodiscard]] std::string describe(const Diffed &diffed, const StreamTraits &terminal, bool all);

}  // namespace redag::cli
