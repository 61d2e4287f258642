// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests whether two sides differ or chance explains the difference. Misses come in bursts, and a test that takes jobs
// for independent finds differences where there are none. Therefore blocks of time, long against the periods, are
// resampled (E. Carlstein, Annals of Statistics 14(3), 1986; how many: B. Schmeiser, Operations Research 30(3), 1982).
// Where a side has several runs, whole runs are resampled first (A. Davison, D. Hinkley, Bootstrap Methods and their
// Application, 1997, section 3.8). Both draw one fewer than there are (J. Rao, C. Wu, JASA 83(401), 1988). Pure
// functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::lab {

/// The jobs that were released in one stretch of a run.
struct Block {
  std::uint64_t released = 0;
  std::uint64_t missed = 0;
  std::vector<Duration> responses;  // of the jobs that finished
};

/// One side: its runs, each as blocks in order of time.
using BlockedRuns = std::vector<std::vector<Block>>;

struct BootstrapOptions {
  std::uint32_t replicates = 4000;
  std::uint64_t seed = 1;  // the same seed gives the same result
  /// Response percentiles that differ by no more than this share of the first side's do not count as different.
  double tolerance = 0.05;
};

/// One figure on both sides. `low` and `high` are the 95 % percentile interval of b - a (B. Efron, R. Tibshirani, An
/// Introduction to the Bootstrap, 1993, chapter 13).
struct FigureDifference {
  double a = 0;
  double b = 0;
  double low = 0;
  double high = 0;
  bool tested = false;  // the data sufficed for a test; otherwise the interval and the p-values mean nothing
  double p_more = 1;    // share of replicates that speak against "b is larger, by more than the tolerance"
  double p_less = 1;

  /// The two-sided p-value.
  [[nodiscard]] double p() const { return p_more < p_less ? two(p_more) : two(p_less); }

 private:
  static double two(double p) { return p < 0.5 ? 2 * p : 1; }
};

struct RowDifference {
  FigureDifference miss_ratio;
  FigureDifference p50;  // ns, as are the two below
  FigureDifference p95;
  FigureDifference p99;
  /// The correlation of neighbouring blocks: that of their miss ratio or of their mean response, whichever is larger.
  /// Above `correlation_limit` it exceeds chance, and the intervals are too narrow.
  double block_correlation = 0;
  double correlation_limit = 0;
};

/// The fewest blocks of a side, and the fewest finished jobs beyond a percentile, that allow a test.
inline constexpr std::size_t kFewestBlocks = 8;
inline constexpr double kFewestJobsBeyond = 10;

/// Compares two sides; deterministic. Intervals of percentiles are read off the pooled responses at 2048 of their
/// ranks, half of them above the 90th percentile; a and b are exact. The maximum is not tested, as no bootstrap can do
/// so (P. Bickel, D. Freedman, Annals of Statistics 9(6), 1981).
[[nodiscard]] RowDifference compare_blocks(const BlockedRuns &a, const BlockedRuns &b, const BootstrapOptions &options);

/// Returns the largest of these p-values that is a discovery at a false discovery rate of `rate` (Y. Benjamini, Y.
/// Hochberg, Journal of the Royal Statistical Society B 57(1), 1995); 0 if none is.
[[nodiscard]] double discovery_threshold(std::vector<double> p_values, double rate = 0.05);

}  // namespace redag::lab
