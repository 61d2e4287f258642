// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of DAGs under global scheduling on m workers, where the first job of a window counts with the shape of
// its DAG and the last one with how parallel it can be. Pure functions.
#pragma once

#include <utility>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {

namespace global {

/// Most work of one job of a DAG on m workers, at the two ends of a window. Both end at the volume.
class Shape {
 public:
  Shape(const System &system, const Unit &unit, std::uint32_t workers);

  /// Left to do `time` before the end of its response: no more than with workers without number, all tasks as early as
  /// they can, ending just then. J. Fonseca, G. Nelissen, V. Nelis, RTNS 2017 (carry-in).
  [[nodiscard]] Duration left(Duration time) const { return at(left_, time); }
  /// Done in any `time` instants: disjoint paths each do no more than `time`. (Of the paper only the question: its
  /// answer comes from a decomposition into nested fork-joins.)
  [[nodiscard]] Duration done(Duration time) const { return at(done_, time); }

  /// In any window of length `x`, if each job is done within `response` of its release: the most over all ways to place
  /// the releases. Requires response <= period.
  [[nodiscard]] Duration work(Duration x, Duration response, Duration period) const;

 private:
  /// Where the slope changes: time and work, by time, from (0, 0) to the volume. Straight in between.
  using Points = std::vector<std::pair<Duration, Duration>>;
  [[nodiscard]] static Duration at(const Points &points, Duration time);
  static Points limited(const Points &points, std::uint32_t workers);

  Points left_;
  Points done_;
};

}  // namespace global

/// R_k = len_k + floor((vol_k - len_k + sum W_j(R_k)) / m), W_j of Shape. After J. Fonseca, G. Nelissen, V. Nelis,
/// RTNS 2017 and Real-Time Systems 55, 2019. Never above melani(). Proof: docs/analysis.md, "Shapes of DAGs".
[[nodiscard]] Method dag_shapes();

}  // namespace redag::analysis
