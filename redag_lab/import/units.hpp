// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which callbacks of a process make one job, and which jobs follow each other. Pure functions.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <string>
#include <vector>

#include "redag_lab/import/recording.hpp"

namespace redag::lab {

using Positions = std::vector<std::size_t>;

inline constexpr std::uint64_t kFewestRuns = 3;  // that tell a rate
inline constexpr double kAll = 0.95;             // of what is as many, but for a few that were lost

/// True if `count` is that share of `whole`, apart from runs or messages that the ends of a recording cut off.
[[nodiscard]] bool is_at_least(std::uint64_t count, double share, std::uint64_t whole);
[[nodiscard]] bool is_as_many(std::uint64_t a, std::uint64_t b);

/// Positions that belong together.
class Clusters {
 public:
  explicit Clusters(std::size_t count) : parents_(count) { std::iota(parents_.begin(), parents_.end(), 0); }
  /// The least position of the cluster.
  [[nodiscard]] std::size_t first(std::size_t position) const {
    while (parents_[position] != position) position = parents_[position];
    return position;
  }
  void join(std::size_t a, std::size_t b) { parents_[std::max(first(a), first(b))] = std::min(first(a), first(b)); }

 private:
  Positions parents_;
};

/// What becomes a task: a callback, or several of a node that together make one job.
struct Unit {
  Positions members;  // in Recording::callbacks(); a timer is first
  metrics::DurationSketch execution{1024};
  std::vector<EndedRun> runs;  // that did the job, in the order of their begin; those of timers have a release
  Positions predecessors;      // units
  std::uint32_t rank = 0;      // among ready ones of its kind
  std::vector<std::string> notes;
};

struct Units {
  std::vector<Unit> units;
  std::vector<std::string> left_out;  // callbacks that are in none, with the reason
  std::uint64_t messages = 0;         // that callbacks of the process took
  Duration explained = 0;             // execution of the callbacks in units
};

/// Finds the units of a process, without their predecessors.
[[nodiscard]] Units find_units(const Recording &recording, std::uint32_t process);

/// Returns a point of a timer's grid, which begins when the timer is created or, later, reset. No event tells of a
/// reset.
[[nodiscard]] Time grid_of(const CallbackRecord &timer);
/// The most by which runs seem to begin before their timer expires: its grid begins before its creation is recorded.
[[nodiscard]] Duration most_early(Duration period);
/// Returns when the timer of a run expired, which seems to begin by up to `early` before.
[[nodiscard]] Time last_expiry(Time grid, Duration period, Time start, Duration early);

/// Fills the predecessors: none of them is in a circle. Notes why an input has none.
void find_edges(const Recording &recording, std::vector<Unit> &units);

}  // namespace redag::lab
