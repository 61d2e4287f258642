// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The experiment "acceptance": which share of random workloads do the methods accept, over utilization? A unit is one
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

/// A unit's result is one character a method, in the plan's order.
inline constexpr char kAccepted = '1';  // every deadline is shown to be met; simulation: no miss was seen
inline constexpr char kNotAccepted = '0';
inline constexpr char kNotApplicable = '-';
inline constexpr char kAcceptedUnsound = 'u';  // the paper's equations say yes where their hypotheses do not hold

/// Units are numbered repetition by repetition, so that what an interrupted run has done covers all points.
[[nodiscard]] std::uint64_t unit_count(const AcceptancePlan &plan);

/// What the generator is asked for at a point.
[[nodiscard]] GenerateOptions generate_options(const AcceptancePlan &plan, const AcceptancePoint &point);

/// Workload `repetition` of a point. Points that differ in preemption alone have the same workloads. In a DAG of
/// several tasks the deadline is end to end. Errors: those of generate().
[[nodiscard]] Result<Workload> draw_workload(const AcceptancePlan &plan, const AcceptancePoint &point,
                                             std::uint64_t repetition);

class Acceptance {
 public:
  /// Requires a plan without mistakes.
  explicit Acceptance(AcceptancePlan plan);

  [[nodiscard]] const AcceptancePlan &plan() const { return plan_; }
  [[nodiscard]] const std::vector<AcceptancePoint> &points() const { return points_; }
  [[nodiscard]] const AcceptancePoint &point_of(std::uint64_t unit) const { return points_[unit % points_.size()]; }

  /// The unit's result. Any number of threads. Errors: those of draw_workload().
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const;

  /// Is this the form of a result?
  [[nodiscard]] bool is_result(std::string_view result) const;

  /// The methods that accept the unit soundly although the simulation saw a miss: a mistake in redag.
  [[nodiscard]] std::vector<std::string> broken_by(std::string_view result) const;
  /// For such a unit: the run with the miss as a workload file, with the command that shows it as a comment.
  [[nodiscard]] Result<std::string> replay(std::uint64_t unit, std::string_view result) const;

 private:
  AcceptancePlan plan_;
  std::vector<AcceptancePoint> points_;
  std::vector<std::size_t> registered_;    // by method of the plan: its place in analysis::methods(), or kNone
  std::optional<std::size_t> simulation_;  // its place in the plan
  bool any_ = false;
};

/// "10 DAGs, 4 workers, implicit deadlines, preemption none, utilization 0.45": for messages.
[[nodiscard]] std::string describe(const AcceptancePoint &point);

}  // namespace redag::experiment
