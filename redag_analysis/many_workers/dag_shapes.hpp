// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of DAGs under global scheduling on m workers. The first job of a window counts with the shape of its
// DAG, and the last one with the parallelism of its DAG. Pure functions.
#pragma once

#include <utility>
#include <vector>

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis {

namespace global {

/// The most work of one job of a DAG on m workers, at the two ends of a window. Both functions end at the volume.
class Shape {
 public:
  Shape(const TaskSet &task_set, const Unit &unit, std::uint32_t workers);

  /// The most work that can be left `time` before the end of the job's response. It is at most what is left in the
  /// schedule that ends then, with all tasks as early as possible on an unlimited number of workers. J. Fonseca, G.
  /// Nelissen, V. Nelis, RTNS 2017 (carry-in).
  [[nodiscard]] Duration left(Duration time) const { return at(left_, time); }
  /// The most work done in any `time` instants: each of the disjoint paths does at most `time`. The paper poses the
  /// same question, and answers it by a decomposition into nested fork-joins.
  [[nodiscard]] Duration done(Duration time) const { return at(done_, time); }

  /// The most work in any window of length `x`, over all placements of the releases, if each job is done within
  /// `response` of its release. Requires response <= period.
  [[nodiscard]] Duration work(Duration x, Duration response, Duration period) const;

 private:
  /// The points where the slope changes, as time and work, ordered by time, from (0, 0) to the volume. Straight in
  /// between.
  using Points = std::vector<std::pair<Duration, Duration>>;
  [[nodiscard]] static Duration at(const Points &points, Duration time);
  static Points limited(const Points &points, std::uint32_t workers);

  Points left_;
  Points done_;
};

}  // namespace global

/// R_k = len_k + floor((vol_k - len_k + sum W_j(R_k)) / m), with W_j of Shape. After J. Fonseca, G. Nelissen, V. Nelis,
/// RTNS 2017 and Real-Time Systems 55, 2019. Proof: docs/analysis.md, "Shapes of DAGs".
[[nodiscard]] Method dag_shapes();

}  // namespace redag::analysis
