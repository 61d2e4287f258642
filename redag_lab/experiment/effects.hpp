// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How much of the variation of a result each factor of a full factorial explains, alone and together with another one:
// the sums of squares of an analysis of variance with equal numbers of runs. Pure.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace redag::experiment {

/// Combinations of levels with the results of their runs.
struct EffectCell {
  std::vector<std::uint32_t> level;  // by factor, from 0
  std::vector<double> results;       // equally many in all cells, at least one
};

struct Effects {
  struct Term {
    std::vector<std::size_t> factors;  // one, or two: their interaction
    double share = 0;                  // of the variation of all results, in [0, 1]
  };
  double mean = 0;
  double variance = 0;                      // of all results
  std::vector<Term> terms;                  // by factor, then by pair
  double higher = 0;                        // interactions of three and more
  double noise = 0;                         // between runs of one combination
  std::vector<std::vector<double>> levels;  // mean results by factor and level
};

/// Requires every combination of the levels once. `counts`: levels by factor. Shares are 0 where nothing varies.
[[nodiscard]] Effects effects_of(const std::vector<std::uint32_t> &counts, const std::vector<EffectCell> &cells);

}  // namespace redag::experiment
