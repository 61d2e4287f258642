// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores all schedules of a strictly periodic task set whose jobs run to completion. Gives the least and the largest
// response of every job, over all release jitters in [0, J] and execution times in [bcet, wcet]. Unlike the
// bounds it relies on the stated offsets. Why that suffices: exploration_search.cpp. M. Nasri, B. Brandenburg, An exact
// and sustainable analysis of non-preemptive scheduling, RTSS 2017; M. Nasri, G. Nelissen, B. Brandenburg,
// Response-time analysis of limited-preemptive parallel DAG tasks under global scheduling, ECRTS 2019.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis {

/// The responses of one job, from the nominal release of its unit to its finish.
struct ResponseRange {
  Duration best = kNever;
  Duration worst = 0;

  friend bool operator==(const ResponseRange &, const ResponseRange &) = default;
};

struct Exploration {
  enum class End : std::uint8_t {
    Complete,  // every schedule was followed until it repeats
    Overrun,   // a job of `late` can end after its unit's next release (on several workers: possibly)
    GaveUp,    // at max_states, or at once if a hyperperiod has more jobs than that
  };
  End end = End::GaveUp;
  bool exact = false;              // each range is tight: one worker
  std::uint64_t states = 0;        // states followed, after merging
  std::uint64_t merged = 0;        // states that were merged into others
  std::uint64_t jobs = 0;          // of one hyperperiod
  std::uint32_t hyperperiods = 0;  // number followed until nothing new was found
  Duration hyperperiod = 0;
  TaskId late;  // only for Overrun
  /// By TaskId and by job number modulo the jobs of one hyperperiod. Complete: over all jobs from time 0 on, without
  /// end. Otherwise they hold what was seen up to the end, and are no bound.
  std::vector<std::vector<ResponseRange>> responses;

  /// The range over all jobs of the task.
  [[nodiscard]] ResponseRange of(TaskId task) const;
};

/// Why the task set cannot be explored: preemption, fifo, edf with data tasks, or a task set that is not analysable.
/// Empty if it can.
[[nodiscard]] std::optional<std::string> why_not_explore(const TaskSet &task_set);

/// Explores the task set. Requires !why_not_explore(task_set). Follows at most max_states states in a time of O(n)
/// each; with edges or gates O(n^2) at worst. On one worker the number of states is pseudo-polynomial only if few jobs
/// are pending at a time.
[[nodiscard]] Exploration explore(const TaskSet &task_set, std::uint64_t max_states = 1'000'000);

}  // namespace redag::analysis
