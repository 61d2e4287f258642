// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Is what was measured on two sides different, or could it be chance? Jobs of a run follow each other: misses come in
// bursts, and a test that takes jobs for independent finds differences where there are none. So what is resampled is
// not jobs but blocks of time, long against the periods (E. Carlstein, Annals of Statistics 14(3), 1986; how many: B.
// Schmeiser, Operations Research 30(3), 1982), and before that whole runs where a side has several (A. Davison, D.
// Hinkley, Bootstrap Methods and their Application, 1997, section 3.8), one fewer of each than there are (J. Rao, C.
// Wu, JASA 83(401), 1988). Pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::metrics {

/// Jobs released in one stretch of a run.
struct Block {
  std::uint64_t released = 0;
  std::uint64_t missed = 0;
  std::vector<Duration> responses;  // of those that finished
};

/// One side: its runs, each in blocks in order of time.
using BlockedRuns = std::vector<std::vector<Block>>;

struct BootstrapOptions {
  std::uint32_t replicates = 4000;
  std::uint64_t seed = 1;
  /// Response percentiles that differ by no more than this share of the first side's are no difference.
  double tolerance = 0.05;
};

/// One figure on both sides. `low` and `high`: 95 % percentile interval of b - a (B. Efron, R. Tibshirani, An
/// Introduction to the Bootstrap, 1993, chapter 13).
struct FigureDifference {
  double a = 0;
  double b = 0;
  double low = 0;
  double high = 0;
  bool tested = false;  // there was enough to test; otherwise what follows and the interval mean nothing
  double p_more = 1;    // share of replicates that speak against "b is larger, by more than the tolerance"
  double p_less = 1;

  /// Two-sided.
  [[nodiscard]] double p() const { return p_more < p_less ? two(p_more) : two(p_less); }

 private:
  static double two(double p) { return p < 0.5 ? 2 * p : 1; }
};

struct RowDifference {
  FigureDifference miss_ratio;
  FigureDifference p50;  // ns, as the ones below
  FigureDifference p95;
  FigureDifference p99;
  /// Correlation of neighbouring blocks, of their miss ratio or their mean response, whichever is larger; and above
  /// what it is more than chance. Then the intervals are too narrow.
  double block_correlation = 0;
  double correlation_limit = 0;
};

/// Fewest blocks of a side, and fewest finished jobs beyond a percentile, for a test.
inline constexpr std::size_t kFewestBlocks = 8;
inline constexpr double kFewestJobsBeyond = 10;

/// Deterministic. Intervals of percentiles are read off the pooled responses at 2048 of their ranks, half of these
/// above the 90th percentile; a and b are exact. The maximum is not tested: no bootstrap can (P. Bickel, D. Freedman,
/// Annals of Statistics 9(6), 1981).
[[nodiscard]] RowDifference compare_blocks(const BlockedRuns &a, const BlockedRuns &b, const BootstrapOptions &options);

/// Which of these p-values are discoveries at a false discovery rate of 5 % (Y. Benjamini, Y. Hochberg, Journal of the
/// Royal Statistical Society B 57(1), 1995): the largest one that is; 0: none.
[[nodiscard]] double discovery_threshold(std::vector<double> p_values, double rate = 0.05);

}  // namespace redag::metrics
