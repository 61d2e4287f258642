// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The tasks whose jobs can go before a job of one task, for any policy, preemption and features. Pure functions; the
// proofs are in docs/analysis.md, "Any features".
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis::any_features {

/// What can delay a job of the task.
struct Rivals {
  std::vector<bool> first;     // by TaskId: its jobs can go first
  std::vector<bool> lifted;    // less urgent holders of groups of those
  std::vector<bool> held_for;  // those for which the task can wait while workers are idle: the rest of its group
  std::vector<bool> fills;     // the rest of its DAG, if a max_active can bind
  bool all = false;
  bool finds_one = false;    // of less urgent holders of its group, it waits for one
  Duration cap = 0;          // the max_active of its DAG
  bool fills_apart = false;  // while its DAG is full, workers can be idle
  Duration blocking = 0;     // the longest stretches of the others, one on each worker
  std::uint32_t divisor = 1;

  /// True if the task can wait for the other one while workers are idle.
  [[nodiscard]] bool are_beside(std::uint32_t other) const { return held_for[other] || fills[other]; }
};

/// `all`: as if every task could go first. `closed`: nothing less urgent fills a DAG of these, or lies under others.
/// `few_threads`: started jobs can hold all threads.
[[nodiscard]] Rivals rivals_of(const TaskSet &task_set, bool few_threads, std::uint32_t t, bool all, bool closed);

/// The place in the order that decides which job goes first.
[[nodiscard]] std::uint32_t place_of(const TaskSet &task_set, std::uint32_t t);

}  // namespace redag::analysis::any_features
