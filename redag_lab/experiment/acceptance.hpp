// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The experiment "acceptance": which share of random workloads the methods accept, over utilization. A unit is one
// workload at one point, judged by all methods of the plan. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/experiment/acceptance_plan.hpp"

namespace redag::experiment {

/// A unit's result has one character per method, in the plan's order.
inline constexpr char kAccepted = '1';  // every deadline is shown to be met; simulation: no miss was seen
inline constexpr char kNotAccepted = '0';
inline constexpr char kNotApplicable = '-';
inline constexpr char kAcceptedUnsound = 'u';  // accepted by the paper's equations where their hypotheses do not hold

/// Units are numbered repetition by repetition. An interrupted run has therefore covered all points evenly.
[[nodiscard]] std::uint64_t unit_count(const AcceptancePlan &plan);

/// Returns the generator's options at a point.
[[nodiscard]] lab::GenerateOptions generate_options(const AcceptancePlan &plan, const AcceptancePoint &point);

/// Draws workload number `repetition` of a point. Points that differ only in preemption have the same workloads. In a
/// DAG of several tasks the deadline is end to end. Errors: those of generate().
[[nodiscard]] Result<Workload> draw_workload(const AcceptancePlan &plan, const AcceptancePoint &point,
                                             std::uint64_t repetition);

class Acceptance {
 public:
  /// Requires a plan without mistakes.
  explicit Acceptance(AcceptancePlan plan);

  [[nodiscard]] const AcceptancePlan &plan() const { return plan_; }
  [[nodiscard]] const std::vector<AcceptancePoint> &points() const { return points_; }
  [[nodiscard]] const AcceptancePoint &point_of(std::uint64_t unit) const { return points_[unit % points_.size()]; }

  /// Evaluates a unit. Any number of threads may call it. Errors: those of draw_workload().
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const;

  /// True if the text has the form of a result.
  [[nodiscard]] bool is_result(std::string_view result) const;

  /// Returns the methods that accept the unit soundly although the simulation saw a miss. Any such method shows a
  /// mistake in redag.
  [[nodiscard]] std::vector<std::string> broken_by(std::string_view result) const;
  /// Returns the run with the miss of such a unit as a workload file. Comments in it name the command that shows the
  /// miss.
  [[nodiscard]] Result<std::string> replay(std::uint64_t unit, std::string_view result) const;

 private:
  AcceptancePlan plan_;
  std::vector<AcceptancePoint> points_;
  std::vector<std::size_t> registered_;    // by method of the plan: index into analysis::methods(), or kNone
  std::optional<std::size_t> simulation_;  // index into the plan's methods
  bool any_ = false;
};

/// Describes a point for messages: "10 DAGs, 4 workers, implicit deadlines, preemption none, utilization 0.45".
[[nodiscard]] std::string describe(const AcceptancePoint &point);

}  // namespace redag::experiment
