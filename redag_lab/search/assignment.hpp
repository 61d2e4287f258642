// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which priorities and which max_active a workload should have: candidates for both, each judged by all bounds of
// analyze(), so that what comes out is as sound as they are, however it was found. Pure functions, but for hooks.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/search/audsley.hpp"

namespace redag::analysis {

enum class Objective : std::uint8_t {
  Lateness,  // smallest max over tasks and DAGs of bound - deadline
  Slack,     // largest min of (deadline - bound) / deadline
};

[[nodiscard]] const char *to_string(Objective objective);

/// How good a workload is. "Deadline" is sooner where the next release would skip a job that has not started.
struct Score {
  bool schedulable = false;
  std::uint32_t unbounded = 0;  // tasks and DAGs with a deadline and no trusted bound
  /// Of the bounded ones; without any, 0. Both are told whatever the objective.
  Duration worst_lateness = 0;
  double least_slack = 0;
  Duration total = 0;  // sum of bounds: breaks ties

  friend bool operator==(const Score &, const Score &) = default;
};

/// Schedulable before not, then fewer without a bound, then the objective, then the smaller sum of bounds.
[[nodiscard]] bool is_better(const Score &a, const Score &b, Objective objective);
/// The same but for the sum: reason enough to change something.
[[nodiscard]] bool improves(const Score &a, const Score &b, Objective objective);

[[nodiscard]] Score score_of(const System &system);

/// One max_active for each DAG, by DagId; 0: no bound.
using Caps = std::vector<std::uint32_t>;

[[nodiscard]] Caps caps_of(const Workload &workload);
[[nodiscard]] Workload with_caps(Workload workload, const Caps &caps);

/// What can make a difference on so many workers, and what there is now: none, and 1 to min(tasks - 1, workers); of a
/// DAG with one task only what there is. Sorted.
[[nodiscard]] Caps cap_choices(const Dag &dag, std::uint32_t workers);

/// Where a local search begins: the present caps, none, all 1; as far as they are among the choices.
[[nodiscard]] std::vector<Caps> cap_starts(const Caps &present, const std::vector<Caps> &choices);

struct Candidate {
  std::string order;  // "present", "rate_monotonic", "deadline_monotonic", "dkc", "audsley"
  Workload workload;  // with the order and the caps
  UnitOrder units;    // most urgent first
  Caps caps;
  Score score;
};

struct AssignmentOptions {
  Objective objective = Objective::Lateness;
  bool priorities = true;  // may change them
  bool caps = true;        // may change max_active
  /// Combinations of max_active up to which all are tried; above, local search from `restarts` + 3 places.
  std::uint64_t exhaustive = 1024;
  std::uint32_t restarts = 8;
  std::uint64_t seed = 1;
  std::function<bool()> stop;  // asked before every analysis; true ends the search with the best so far
};

struct Trial {
  Caps caps;
  Score score;
};

struct Assignment {
  Candidate present;              // the workload as it is
  Candidate best;                 // equal to `present` where nothing is better
  std::vector<Candidate> orders;  // one for each order tried, with its best caps; the present one first
  std::vector<Trial> trials;      // every combination of caps tried under the best order, in order of caps
  bool exhaustive = true;         // all combinations of caps were tried, for every order
  std::uint64_t analyses = 0;
  bool stopped = false;

  /// Audsley's assignment: by which test, whether it is optimal for it, whether every unit passed. Or why it was not
  /// tried.
  std::string audsley_test;
  bool audsley_optimal = false;
  bool audsley_found = false;
  std::string audsley_reason;
};

/// Error: compile(). Orders tried: the present one, rate and deadline monotonic, D - k L, Audsley's; only the present
/// one where the policy has no static priorities and the workload is schedulable. For each order max_active of every
/// DAG with more than one task is searched over none and 1 to min(tasks - 1, workers). The local search changes one DAG
/// at a time to its best value until nothing helps, from the present caps, none, all 1 and random ones.
[[nodiscard]] Result<Assignment> assign(const Workload &workload, const AnalysisPlatform &platform,
                                        const AssignmentOptions &options = {});

}  // namespace redag::analysis
