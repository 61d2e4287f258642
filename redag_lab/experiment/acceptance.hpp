// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The experiment "acceptance": which share of random workloads the methods accept, over utilization. A unit is one
// workload at one point, judged by all methods of the plan. Pure functions.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/loader/workload_yaml_tree.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"
#include "redag_lab/experiment/experiment.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::experiment {

struct SimulationEffort {
  std::uint32_t offsets = 5;  // runs with random offsets, besides the one in which all tasks are released together
  std::uint32_t periods = 5;  // length of a run, in periods of the slowest task

  friend bool operator==(const SimulationEffort &, const SimulationEffort &) = default;
};

/// True if some run misses a deadline; every job executes for its wcet. A miss is a response above the deadline, a
/// DAG's instance above its end-to-end deadline, or a skipped job. `task_set` is `workload` compiled on the platform
/// that it states.
[[nodiscard]] bool sees_miss(const Workload &workload, const analysis::TaskSet &task_set,
                             const SimulationEffort &effort, std::uint64_t seed);

/// Methods besides those of analysis::methods().
inline constexpr std::string_view kAnyMethod = "any";                // analysis::analyze(): all sound methods together
inline constexpr std::string_view kSimulationMethod = "simulation";  // accepts where no miss was seen

struct AcceptancePlan {
  std::string name = "acceptance";
  std::uint64_t seed = 1;
  std::uint32_t sets = 100;  // workloads at each point
  // The points are all combinations. Utilization is per worker, in millionths.
  std::vector<std::uint32_t> utilization;
  std::vector<std::uint32_t> dags = {10};
  std::vector<std::uint32_t> workers = {4};
  std::vector<PreemptionMode> preemption = {PreemptionMode::None, PreemptionMode::Os};
  std::vector<std::string> methods = {std::string(kAnyMethod), std::string(kSimulationMethod)};
  /// Common to all points; a point's own values replace these.
  lab::GenerateOptions workload;
  SimulationEffort simulation;

  /// The default plan has single-task DAGs and utilizations from 0.05 to 1 in steps of 0.05.
  AcceptancePlan();
};
/// Reads a plan. Errors: every mistake with its place in `file`.
[[nodiscard]] Result<AcceptancePlan> read_acceptance_plan(const yaml::Node &root, const std::string &file);

/// Returns the factors of the points: dags, workers, preemption, utilization.
[[nodiscard]] std::vector<Factor> factors_of(const AcceptancePlan &plan);
/// Returns the generator's options at a point.
[[nodiscard]] lab::GenerateOptions generate_options(const AcceptancePlan &plan, const Point &point);

/// A unit's result has one character per method, in the plan's order.
inline constexpr char kAccepted = '1';  // every deadline is shown to be met; simulation: no miss was seen
inline constexpr char kNotAccepted = '0';
inline constexpr char kNotApplicable = '-';
inline constexpr char kAcceptedUnsound = 'u';  // accepted by the paper's equations where their hypotheses do not hold

class Acceptance final : public Experiment {
 public:
  /// Requires a plan without mistakes.
  explicit Acceptance(AcceptancePlan plan);

  [[nodiscard]] const std::vector<Point> &points() const { return points_; }
  [[nodiscard]] std::uint64_t unit_count() const override { return points_.size() * plan_.sets; }
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const override;
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result) override;
  [[nodiscard]] Result<Results> results() const override;

  /// Draws a unit's workload. Units that differ only in preemption have the same workload. In a DAG of several tasks
  /// the deadline is end to end. Errors: those of generate().
  [[nodiscard]] Result<Workload> draw(std::uint64_t unit) const;
  /// Returns the methods that accept the unit soundly although the simulation saw a miss. Any such method shows a
  /// mistake in redag.
  [[nodiscard]] std::vector<std::string> broken_by(std::string_view result) const;

 private:
  /// The counts of one method at one point.
  struct Count {
    std::uint64_t accepted = 0;        // includes `unsound`
    std::uint64_t unsound = 0;         // accepted by an equation whose hypotheses do not hold
    std::uint64_t not_applicable = 0;  // counted as not accepted
  };

  [[nodiscard]] std::uint64_t seed_of(std::uint64_t unit) const;

  AcceptancePlan plan_;
  std::vector<Factor> factors_;
  std::vector<Point> points_;
  std::vector<std::size_t> registered_;    // by method of the plan: index into analysis::methods(), or kNone
  std::optional<std::size_t> simulation_;  // index into the plan's methods
  bool any_ = false;
  std::vector<std::uint64_t> sets_;                                // finished, by point
  std::vector<std::vector<Count>> counts_;                         // by point and method
  std::vector<std::pair<std::uint64_t, std::string>> violations_;  // unit and result
};

}  // namespace redag::experiment
