// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a workload does in the simulator, over several seeds, in the numbers that `tune` compares; and which of two such
// results is better. Observations, not bounds: other seeds can be worse. Pure but for `stop`.
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
  MaxLateness,  // smallest largest f - (r + D); before that fewest lost jobs, which have no f
  Slack,        // largest least (r + D - f) / D; before that fewest lost jobs
};

[[nodiscard]] const char *to_string(Objective objective);

/// Jobs of one criticality (their DAG's). End-to-end deadlines count as the deadlines of the jobs that carry the data.
struct ClassScore {
  std::uint64_t released = 0;
  std::uint64_t missed = 0;  // lost or late; in flight past the deadline is late
  std::uint64_t lost = 0;    // skipped, or aborted though there was data
  Duration max_lateness = 0;
  double least_slack = 1;
  bool any = false;  // some job had a response: the two above mean something

  void add(const ClassScore &other);
  friend bool operator==(const ClassScore &, const ClassScore &) = default;
};

inline constexpr std::size_t kCriticalities = 3;

struct Score {
  std::array<ClassScore, kCriticalities> of;  // by Criticality
  bool proven = false;                        // every deadline is shown to hold by a bound
  std::uint32_t changes = 0;                  // from the workload as it is

  [[nodiscard]] ClassScore all() const;
  friend bool operator==(const Score &, const Score &) = default;
};

struct Goal {
  Objective objective = Objective::Misses;
  /// What a more critical DAG gains counts before all that a less critical one may lose.
  bool per_criticality = false;
};

/// Proven before not; then the objective. Reason enough to change something.
[[nodiscard]] bool improves(const Score &a, const Score &b, const Goal &goal);
/// The same, and of equals the one with more slack, then with fewer changes.
[[nodiscard]] bool is_better(const Score &a, const Score &b, const Goal &goal);

struct Simulation {
  Duration duration = 10 * kSecond;
  sim::Overheads overheads;
};

/// One run with our scheduler. Nothing if `stop` ended it.
[[nodiscard]] std::optional<std::array<ClassScore, kCriticalities>> simulate_once(const Workload &workload,
                                                                                  std::uint64_t seed,
                                                                                  const Simulation &simulation,
                                                                                  const std::atomic<bool> *stop);

}  // namespace redag::tune
