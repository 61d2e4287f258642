// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The plan of the experiment "acceptance": which random workloads are drawn at which points, and which methods judge
// them. docs/experiments.md describes the text form. Plain values; pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/simulated_misses.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::experiment {

enum class DeadlineKind : std::uint8_t {
  Implicit,     // D = T
  Constrained,  // D / T uniform in [0.5, 1], never below C
};

/// Methods besides those of analysis::methods().
inline constexpr std::string_view kAnyMethod = "any";                // analysis::analyze(): all sound methods together
inline constexpr std::string_view kSimulationMethod = "simulation";  // accepts where no miss was seen

struct AcceptancePlan {
  std::string name = "acceptance";
  std::uint64_t seed = 1;
  std::uint32_t sets = 100;  // workloads at each point
  // The points are all combinations. Utilization is per worker, in millionths, which are exact on every machine.
  std::vector<std::uint32_t> utilization;
  std::vector<std::uint32_t> dags = {10};
  std::vector<std::uint32_t> workers = {4};
  std::vector<DeadlineKind> deadlines = {DeadlineKind::Implicit};
  std::vector<PreemptionMode> preemption = {PreemptionMode::None, PreemptionMode::Os};
  std::vector<std::string> methods = {std::string(kAnyMethod), std::string(kSimulationMethod)};
  /// Common to all points; a point's own values replace these.
  lab::GenerateOptions workload;
  SimulationEffort simulation;

  /// The default plan has single-task DAGs and utilizations from 0.05 to 1 in steps of 0.05.
  AcceptancePlan();
};

inline constexpr std::uint32_t kMillion = 1'000'000;

/// One point of the grid. The order of points is that of nested loops over the plan's lists, in the order of members.
struct AcceptancePoint {
  std::uint32_t dags = 0;
  std::uint32_t workers = 0;
  DeadlineKind deadlines = DeadlineKind::Implicit;
  PreemptionMode preemption = PreemptionMode::None;
  std::uint32_t utilization = 0;  // per worker, millionths
};

[[nodiscard]] std::vector<AcceptancePoint> points_of(const AcceptancePlan &plan);

/// A mistake in a plan, with the key of the text form that contains it.
struct PlanMistake {
  std::string key;
  std::string message;
  std::string hint;
};
[[nodiscard]] std::vector<PlanMistake> find_mistakes(const AcceptancePlan &plan);

/// Returns the canonical text. Equal plans have equal texts, and parse_acceptance_plan() restores the plan.
[[nodiscard]] std::string to_yaml(const AcceptancePlan &plan);
/// Errors: every mistake with its place in `file`.
[[nodiscard]] Result<AcceptancePlan> parse_acceptance_plan(std::string_view text, const std::string &file);
[[nodiscard]] Result<AcceptancePlan> load_acceptance_plan(const std::string &path);

/// Parses "0.05:1:0.05" (from:to:step) or "0.1,0.5" into millionths. Error: another form.
[[nodiscard]] Result<std::vector<std::uint32_t>> parse_utilization(std::string_view text);

[[nodiscard]] const char *to_string(DeadlineKind value);

}  // namespace redag::experiment
