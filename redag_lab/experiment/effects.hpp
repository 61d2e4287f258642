// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Divides the variation of a result among the factors of a full factorial, each alone and in pairs. The shares are the
// sums of squares of an analysis of variance with equal numbers of runs. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace redag::experiment {

/// A combination of levels with the results of its runs.
struct EffectCell {
  std::vector<std::uint32_t> level;  // by factor, from 0
  std::vector<double> results;       // same number in all cells, at least one
};

struct Effects {
  struct Term {
    std::vector<std::size_t> factors;  // one factor, or two for their interaction
    double share = 0;                  // of the variation of all results, in [0, 1]
  };
  double mean = 0;
  double variance = 0;                      // of all results
  std::vector<Term> terms;                  // by factor, then by pair
  double higher = 0;                        // interactions of three and more
  double noise = 0;                         // between runs of one combination
  std::vector<std::vector<double>> levels;  // mean results by factor and level
};

/// Requires every combination of the levels once. `counts` holds the number of levels by factor. Shares are 0 if
/// nothing varies.
[[nodiscard]] Effects effects_of(const std::vector<std::uint32_t> &counts, const std::vector<EffectCell> &cells);

}  // namespace redag::experiment
