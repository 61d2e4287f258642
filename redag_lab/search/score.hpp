// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `assign` and `tune` look for: the objective, the score of a candidate by its bounds or by simulated runs, and
// the comparison of two scores. Scores of runs are observations, not bounds: other seeds can be worse. Pure, apart from
// `stop`.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::lab {

enum class Objective : std::uint8_t {
  Misses,    // of runs: fewest jobs late or lost
  Lateness,  // smallest maximum of response - deadline; of runs, fewer lost jobs (without a response) come first
  Slack,     // largest minimum of (deadline - response) / deadline; lost jobs as above
};

/// "misses", "lateness" or "slack".
[[nodiscard]] const char *to_string(Objective objective);

/// The extremes of responses, or of bounds on them, against their deadlines.
struct Extremes {
  Duration worst_lateness = 0;
  double least_slack = 1;
  bool any = false;  // something was seen, and the others are valid

  void see(Duration response, Duration due);
  void add(const Extremes &other);
  friend bool operator==(const Extremes &, const Extremes &) = default;
};

/// The quality of a workload by its bounds. The deadline counts as sooner where the next release would skip a job that
/// has not started.
struct BoundScore {
  bool schedulable = false;
  std::uint32_t unbounded = 0;  // tasks and DAGs with a deadline and no trusted bound
  Extremes extremes;            // of the bounded tasks and DAGs
  Duration total = 0;           // sum of bounds; breaks ties

  friend bool operator==(const BoundScore &, const BoundScore &) = default;
};

[[nodiscard]] BoundScore score_of(const analysis::TaskSet &task_set);

/// True if `a` is better: schedulable, fewer without a bound, then the objective (Lateness or Slack). This justifies a
/// change.
[[nodiscard]] bool improves(const BoundScore &a, const BoundScore &b, Objective objective);
/// As improves(); equals are decided by the smaller sum of bounds.
[[nodiscard]] bool is_better(const BoundScore &a, const BoundScore &b, Objective objective);

/// Counts of the jobs of one criticality (their DAG's). An end-to-end deadline counts as the deadline of the jobs that
/// carry the data.
struct ClassScore {
  std::uint64_t released = 0;
  std::uint64_t missed = 0;  // lost or late; a job in flight past its deadline is late
  std::uint64_t lost = 0;    // skipped, or aborted although there was data
  Extremes extremes;         // of the jobs with a response

  void add(const ClassScore &other);
  friend bool operator==(const ClassScore &, const ClassScore &) = default;
};

inline constexpr std::size_t kCriticalities = 3;

/// The quality of a workload in simulated runs.
struct RunScore {
  std::array<ClassScore, kCriticalities> of;  // by Criticality
  bool proven = false;                        // bounds show that every deadline is met
  std::uint32_t changes = 0;                  // number of differences from the present workload

  [[nodiscard]] ClassScore all() const;
  friend bool operator==(const RunScore &, const RunScore &) = default;
};

struct Goal {
  Objective objective = Objective::Misses;
  /// A gain of a more critical DAG outweighs every loss of less critical ones.
  bool per_criticality = false;
};

/// A proven setting wins, then the objective; true justifies a change.
[[nodiscard]] bool improves(const RunScore &a, const RunScore &b, const Goal &goal);
/// As improves(); equals are decided by more slack, then by fewer changes.
[[nodiscard]] bool is_better(const RunScore &a, const RunScore &b, const Goal &goal);

struct Simulation {
  Duration duration = 10 * kSecond;
  sim::Overheads overheads;
};

/// Simulates one run with our scheduler. Returns nothing if `stop` ended it.
[[nodiscard]] std::optional<std::array<ClassScore, kCriticalities>> simulate_once(const Workload &workload,
                                                                                  std::uint64_t seed,
                                                                                  const Simulation &simulation,
                                                                                  const std::atomic<bool> *stop);

}  // namespace redag::lab
