// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Exploration of all schedules of a strictly periodic system whose jobs run to completion: the least and the largest
// response of every job, over all release jitters in [0, J] and execution times in [bcet, wcet]. Unlike the other
// methods it takes the offsets at their word. What is explored and why that suffices: docs/analysis.md, "Exploration".
//
// M. Nasri, B. Brandenburg, An exact and sustainable analysis of non-preemptive scheduling, RTSS 2017; M. Nasri,
// G. Nelissen, B. Brandenburg, Response-time analysis of limited-preemptive parallel DAG tasks under global scheduling,
// ECRTS 2019.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

struct ExplorationProgress {
  std::uint64_t states = 0;
  std::uint64_t jobs = 0;             // dispatched on every path so far
  std::uint64_t jobs_in_a_round = 0;  // of one hyperperiod; rarely more than one or two rounds are needed
};

struct ExplorationOptions {
  std::uint64_t max_states = 1'000'000;
  /// Called now and then; false stops the exploration. Empty: it goes on.
  std::function<bool(const ExplorationProgress &)> proceed;
};

/// Of one job, from the nominal release of its unit to its finish.
struct ResponseRange {
  Duration best = kNever;
  Duration worst = 0;

  friend bool operator==(const ResponseRange &, const ResponseRange &) = default;
};

struct Exploration {
  enum class End : std::uint8_t {
    Complete,  // every schedule was followed until it repeats
    Overrun,   // a job of `late` can end after its unit's next release (with several workers: possibly)
    GaveUp,    // at max_states, or before the first one where a hyperperiod has more jobs than that
    Stopped,   // by `proceed`
  };
  End end = End::GaveUp;
  bool exact = false;              // each range is tight: one worker, and the order of equals is always sure
  std::uint64_t states = 0;        // followed, after merging
  std::uint64_t merged = 0;        // that went up in others
  std::uint64_t jobs = 0;          // of one hyperperiod
  std::uint32_t hyperperiods = 0;  // followed until nothing new was found
  Duration hyperperiod = 0;
  TaskId late;  // with Overrun
  /// By TaskId and by job number modulo the jobs of one hyperperiod. Complete: over all jobs for ever. Otherwise: what
  /// was seen so far, no bound.
  std::vector<std::vector<ResponseRange>> responses;

  /// Over all jobs of the task.
  [[nodiscard]] ResponseRange of(TaskId task) const;
};

/// Why there is nothing to explore, if so: preemption, fifo, edf with data tasks, a system that is not analysable.
[[nodiscard]] std::optional<std::string> why_not_explore(const System &system);

/// Requires !why_not_explore(system). At most max_states states and a time of O(n) for each, pseudo-polynomial for one
/// worker only where few jobs are pending at a time.
[[nodiscard]] Exploration explore(const System &system, const ExplorationOptions &options = {});

/// What an exploration says as a bound: the largest responses if it is complete.
[[nodiscard]] Bound to_bound(const System &system, const Exploration &exploration);

/// explore() as a method. Not one of methods(): it can take long.
[[nodiscard]] Method exploration(ExplorationOptions options = {});

}  // namespace redag::analysis
