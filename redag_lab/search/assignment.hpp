// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds better priorities and max_active for a workload. Every candidate is judged by all bounds of analyze(). The
// result is therefore as sound as these bounds, however it was found. Pure functions, apart from hooks.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag_analysis/analyze/analyze.hpp"
#include "redag_lab/search/audsley.hpp"

namespace redag::analysis {

enum class Objective : std::uint8_t {
  Lateness,  // minimises the largest bound - deadline over tasks and DAGs
  Slack,     // maximises the least (deadline - bound) / deadline
};

[[nodiscard]] const char *to_string(Objective objective);

/// The quality of a workload. The deadline counts as sooner where the next release would skip a job that has not
/// started.
struct Score {
  bool schedulable = false;
  std::uint32_t unbounded = 0;  // tasks and DAGs with a deadline and no trusted bound
  /// Over the bounded tasks and DAGs; 0 without any. Both are computed for either objective.
  Duration worst_lateness = 0;
  double least_slack = 0;
  Duration total = 0;  // sum of bounds; breaks ties

  friend bool operator==(const Score &, const Score &) = default;
};

/// True if `a` is better. The criteria are, in this order: schedulable, fewer without a bound, the objective, the
/// smaller sum of bounds.
[[nodiscard]] bool is_better(const Score &a, const Score &b, Objective objective);
/// As is_better(), without the sum of bounds; true justifies a change.
[[nodiscard]] bool improves(const Score &a, const Score &b, Objective objective);

[[nodiscard]] Score score_of(const TaskSet &task_set);

/// The max_active of each DAG, by DagId; 0: no bound.
using Caps = std::vector<std::uint32_t>;

[[nodiscard]] Caps caps_of(const Workload &workload);
[[nodiscard]] Workload with_caps(Workload workload, const Caps &caps);

/// Returns the values of max_active worth trying, sorted: the present one, none, and 1 to min(tasks - 1, workers). A
/// DAG with one task has only its present value.
[[nodiscard]] Caps cap_choices(const Dag &dag, std::uint32_t workers);

/// Returns the starts of a local search: the present caps, none and all 1, each as far as it is among the choices.
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
  /// With at most this many combinations of max_active, all are tried. Otherwise a local search runs from
  /// `restarts` + 3 starts.
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
  Candidate best;                 // equal to `present` if no other is better
  std::vector<Candidate> orders;  // the best of each order tried, the present order first
  std::vector<Trial> trials;      // all caps tried under the best order, in order of caps
  bool exhaustive = true;         // all combinations of caps were tried for every order
  std::uint64_t analyses = 0;
  bool stopped = false;

  /// Audsley's assignment: its test, whether it is optimal for the test, and whether every unit passed; or the reason
  /// why it was not tried.
  std::string audsley_test;
  bool audsley_optimal = false;
  bool audsley_found = false;
  std::string audsley_reason;
};

/// Searches priorities and caps. The orders tried are the present one, rate and deadline monotonic, D - k L, and
/// Audsley's. Only the present one is tried where the policy has no static priorities and the workload is schedulable.
/// For each order, the max_active of every DAG with several tasks ranges over none and 1 to min(tasks - 1, workers).
/// The local search changes one DAG at a time to its best value until nothing improves. It starts from the present
/// caps, none, all 1 and random ones. Error: of compile().
[[nodiscard]] Result<Assignment> assign(const Workload &workload, const AnalysisPlatform &platform,
                                        const AssignmentOptions &options = {});

}  // namespace redag::analysis
