// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds better priorities and max_active for a workload. Every candidate is judged by all bounds of analyze(). The
// result is therefore as sound as these bounds, however it was found. Pure functions, apart from hooks.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "redag_lab/search/audsley.hpp"
#include "redag_lab/search/score.hpp"

namespace redag::lab {

/// The max_active of each DAG, by DagId; 0: no bound.
using Caps = std::vector<std::uint32_t>;

[[nodiscard]] Caps caps_of(const Workload &workload);
[[nodiscard]] Workload with_caps(Workload workload, const Caps &caps);

/// Returns the values of max_active worth trying, sorted: the present one, none, and 1 to min(tasks - 1, workers). A
/// DAG with one task has only its present value.
[[nodiscard]] Caps cap_choices(const Dag &dag, std::uint32_t workers);

/// Returns the starts of a local search: the present caps, none and all 1, each as far as it is among the choices.
[[nodiscard]] std::vector<Caps> cap_starts(const Caps &present, const std::vector<Caps> &choices);

struct OrderCandidate {
  std::string order;  // "present", "rate_monotonic", "deadline_monotonic", "dkc", "audsley"
  Workload workload;  // with the order and the caps
  UnitOrder units;    // most urgent first
  Caps caps;
  BoundScore score;
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

struct Assignment {
  OrderCandidate present;              // the workload as it is
  OrderCandidate best;                 // equal to `present` if no other is better
  std::vector<OrderCandidate> orders;  // the best of each order tried, the present order first
  std::map<Caps, BoundScore> trials;   // all caps tried under the best order
  bool exhaustive = true;              // all combinations of caps were tried for every order
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
[[nodiscard]] Result<Assignment> assign(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                        const AssignmentOptions &options = {});

}  // namespace redag::lab
