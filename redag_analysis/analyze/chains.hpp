// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// End-to-end bounds of cause-effect chains: how long until an input shows in the output (reaction), and how old the
// input behind an output is just before the next output (age). The bounds combine response bounds of a method. Tasks
// read when they start and write when they end; within a DAG data follow the edges. Pure functions.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// A part of a chain that edges join: job k hands over to job k. A task without such edges is a segment of its own.
struct ChainSegment {
  TaskId first;
  TaskId last;
  Duration period = 0;
  Duration response = 0;  // from the release of the unit to the finish of `last`
  Duration hop = 0;       // what it adds to reaction and age: period + response, or ResponseBound::hop
};

struct ChainBound {
  std::vector<ChainSegment> segments;
  /// The sum of the hops, which are T + R, for both reaction and age: A. Davare, Q. Zhu, M. Di Natale, C. Pinello, S.
  /// Kanajan, A. Sangiovanni-Vincentelli, DAC 2007. A single segment is an event-driven chain, T + R.
  Duration sum = 0;
  /// The reaction where a priority discount holds: M. Duerr, G. von der Brueggen, K.-H. Chen, J.-J. Chen, TECS 18(5s),
  /// 2019. One worker only: on several the consumer can start beside its more urgent producer.
  std::optional<Duration> one_worker;

  /// The smaller of the two.
  [[nodiscard]] Duration reaction() const { return one_worker ? std::min(*one_worker, sum) : sum; }
  [[nodiscard]] Duration age() const { return sum; }
};

/// Bounds reaction and age of `chain`, TaskIds in the order of the data, over strictly periodic timers (no sporadic
/// gaps). Consecutive tasks of one unit hand over job by job if an edge joins them. Others hand over by a register (the
/// latest value), also over an edge between rates. NotApplicable for a chain without tasks, and for a task without a
/// bound in `bound` or with one above its period.
[[nodiscard]] std::variant<NotApplicable, ChainBound> chain_bound(const TaskSet &task_set,
                                                                  std::span<const TaskId> chain, const Bound &bound);

/// A task under logical execution time: it reads at its release, and writes `deadline` after it.
struct LetTask {
  Duration period = 0;
  Duration offset = 0;
  Duration deadline = 0;
};

/// The exact reaction time of a LET chain in steady state: the longest z' - z where an input right after z, a release
/// of the first task, first shows at z'. Follows forward chains over a hyperperiod; age is the same (M. Guenzel et al.,
/// ECRTS 2023). Empty for an empty chain, or above `most_jobs` jobs of the first task in a hyperperiod.
[[nodiscard]] std::optional<Duration> let_reaction(std::span<const LetTask> chain, std::int64_t most_jobs = 1'000'000);

}  // namespace redag::analysis
