// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A system as exploration.cpp follows it: numbers by task, and where a state keeps what. Plain values, immutable.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/core/system.hpp"

namespace redag::analysis {

/// Of hyperperiods, offsets and jitter: no sum of times overflows below it.
inline constexpr Duration kLongestExplored = kMaxDuration / 16;

inline constexpr std::uint32_t kNowhere = 0xffffffff;

/// What must have room for a job to start: the workers, its DAG's max_active, its group. A state has an interval for
/// each place: when the first, the second, ... is free.
struct Gate {
  std::uint32_t first = 0;  // place in the state
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
  std::uint32_t jobs = 0;  // of a hyperperiod
  std::vector<std::uint32_t> predecessors;
  std::vector<std::uint32_t> successors;
  std::vector<Gate> gates;
  std::uint32_t finish = kNowhere;  // place in the state of the last job's finish, where successors need it
  std::uint64_t hash = 0;           // a count's share in the hash is count * hash
};

struct ExplorationModel {
  std::uint32_t workers = 1;
  std::vector<ExploredTask> tasks;  // by TaskId
  std::uint32_t width = 0;          // intervals of a state: the workers, places of gates, last finishes
  Duration hyperperiod = 0;
  std::uint64_t jobs = 0;        // of a hyperperiod; above the limit asked for, the rest is not filled in
  std::uint64_t round_hash = 0;  // share of a hyperperiod's jobs in the hash
};

/// kUnbounded above kLongestExplored.
[[nodiscard]] Duration hyperperiod_of(const System &system);

/// Requires a hyperperiod of at most kLongestExplored. O(n + edges).
[[nodiscard]] ExplorationModel exploration_model(const System &system, std::uint64_t max_jobs);

}  // namespace redag::analysis
