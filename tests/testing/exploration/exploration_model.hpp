// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A task set in the form that exploration.cpp follows: numbers by task, and the layout of a state. Plain values,
// immutable.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis {

/// The limit on hyperperiods, offsets and jitter; below it no sum of times overflows.
inline constexpr Duration kLongestExplored = kMaxDuration / 16;

inline constexpr std::uint32_t kNowhere = 0xffffffff;

/// What must have room for a job to start: the workers, its DAG's max_active, or its group. A state has an interval for
/// each place, which says when the first, the second, ... place is free.
struct Gate {
  std::uint32_t first = 0;  // index of its first interval in the state
  std::uint32_t places = 0;

  friend bool operator==(const Gate &, const Gate &) = default;
};

struct ExploredTask {
  Time offset = 0;  // of its unit
  Duration period = 0;
  Duration bcet = 0;
  Duration wcet = 0;
  Duration jitter = 0;
  Duration deadline = 0;
  std::uint32_t jobs = 0;  // in a hyperperiod
  std::vector<std::uint32_t> predecessors;
  std::vector<std::uint32_t> successors;
  std::vector<Gate> gates;
  std::uint32_t finish = kNowhere;  // index in the state of the last job's finish, if successors need it
  std::uint64_t hash = 0;           // a count adds count * hash to the hash of a node
};

struct ExplorationModel {
  std::uint32_t workers = 1;
  std::vector<ExploredTask> tasks;  // by TaskId
  std::uint32_t width = 0;          // intervals of a state: the workers, places of gates, last finishes
  Duration hyperperiod = 0;
  std::uint64_t jobs = 0;        // in a hyperperiod; if above the given limit, the rest is not filled in
  std::uint64_t round_hash = 0;  // the part of a hyperperiod's jobs in the hash
};

/// The hyperperiod; kUnbounded if it is above kLongestExplored.
[[nodiscard]] Duration hyperperiod_of(const TaskSet &task_set);

/// Builds the model. Requires a hyperperiod of at most kLongestExplored. O(n + edges).
[[nodiscard]] ExplorationModel exploration_model(const TaskSet &task_set, std::uint64_t max_jobs);

}  // namespace redag::analysis
