// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// End-to-end bounds of cause-effect chains: how long until an input shows in the output (reaction), and how old the
// input behind an output is just before the next output (age). Response bounds come from a method; here they are put
// together. Tasks read when they start and write when they end; within a DAG data follow the edges. Pure functions.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Part of a chain that edges join: job k hands over to job k. A task of its own where it is joined to nothing.
struct ChainSegment {
  TaskId first;
  TaskId last;
  Duration period = 0;
  Duration response = 0;  // from the release of the unit to the finish of `last`
};

struct ChainBound {
  std::vector<ChainSegment> segments;
  /// Sum of T + R over the segments: A. Davare, Q. Zhu, M. Di Natale, C. Pinello, S. Kanajan, A.
  /// Sangiovanni-Vincentelli, DAC 2007. One segment: an event-driven chain, T + R. Of reaction and age alike.
  Duration sum = 0;
  /// Reaction where a priority discount holds: M. Duerr, G. von der Brueggen, K.-H. Chen, J.-J. Chen, TECS 18(5s),
  /// 2019. One worker only: with more the consumer can start beside its more urgent producer.
  std::optional<Duration> one_worker;

  /// The smaller of the two.
  [[nodiscard]] Duration reaction() const { return one_worker ? std::min(*one_worker, sum) : sum; }
  [[nodiscard]] Duration age() const { return sum; }
};

/// Reaction and age of `chain`, TaskIds in the order of the data, over strictly periodic timers (no sporadic gaps).
/// Consecutive tasks of one unit must be joined by an edge to hand over job by job; others hand over by a register (the
/// latest value). NotApplicable: a task without a bound in `bound` or with one above its period; a chain without tasks.
[[nodiscard]] std::variant<NotApplicable, ChainBound> chain_bound(const System &system, std::span<const TaskId> chain,
                                                                  const Bound &bound);

/// A task under logical execution time: reads at its release, writes `deadline` after it.
struct LetTask {
  Duration period = 0;
  Duration offset = 0;
  Duration deadline = 0;
};

/// Exact reaction time of a LET chain in steady state: the longest z' - z where an input right after z, a release of
/// the first task, first shows at z'. Forward chains over a hyperperiod; age is the same (M. Guenzel et al., ECRTS
/// 2023). Nothing for an empty chain or above `most_jobs` jobs of the first task in a hyperperiod.
[[nodiscard]] std::optional<Duration> let_reaction(std::span<const LetTask> chain, std::int64_t most_jobs = 1'000'000);

}  // namespace redag::analysis
