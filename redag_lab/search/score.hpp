// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The figures of a workload in the simulator over several seeds, which `tune` compares, and the comparison of two such
// results. They are observations, not bounds: other seeds can be worse. Pure, apart from `stop`.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::tune {

enum class Objective : std::uint8_t {
  Misses,       // fewest jobs late or lost
  MaxLateness,  // smallest maximum of f - (r + D); fewer lost jobs (which have no f) come first
  Slack,        // largest minimum of (r + D - f) / D; fewer lost jobs come first
};

[[nodiscard]] const char *to_string(Objective objective);

/// Counts of the jobs of one criticality (their DAG's). An end-to-end deadline counts as the deadline of the jobs that
/// carry the data.
struct ClassScore {
  std::uint64_t released = 0;
  std::uint64_t missed = 0;  // lost or late; a job in flight past its deadline is late
  std::uint64_t lost = 0;    // skipped, or aborted although there was data
  Duration max_lateness = 0;
  double least_slack = 1;
  bool any = false;  // some job had a response, and max_lateness and least_slack are valid

  void add(const ClassScore &other);
  friend bool operator==(const ClassScore &, const ClassScore &) = default;
};

inline constexpr std::size_t kCriticalities = 3;

struct Score {
  std::array<ClassScore, kCriticalities> of;  // by Criticality
  bool proven = false;                        // bounds show that every deadline is met
  std::uint32_t changes = 0;                  // number of differences from the present workload

  [[nodiscard]] ClassScore all() const;
  friend bool operator==(const Score &, const Score &) = default;
};

struct Goal {
  Objective objective = Objective::Misses;
  /// A gain of a more critical DAG outweighs every loss of less critical ones.
  bool per_criticality = false;
};

/// A proven setting wins, then the objective; true justifies a change.
[[nodiscard]] bool improves(const Score &a, const Score &b, const Goal &goal);
/// As improves(); equals are decided by more slack, then by fewer changes.
[[nodiscard]] bool is_better(const Score &a, const Score &b, const Goal &goal);

struct Simulation {
  Duration duration = 10 * kSecond;
  sim::Overheads overheads;
};

/// Simulates one run with our scheduler. Returns nothing if `stop` ended it.
[[nodiscard]] std::optional<std::array<ClassScore, kCriticalities>> simulate_once(const Workload &workload,
                                                                                  std::uint64_t seed,
                                                                                  const Simulation &simulation,
                                                                                  const std::atomic<bool> *stop);

}  // namespace redag::tune
