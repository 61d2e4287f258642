// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The experiment "factorial": every executor on every combination of the factors' levels. A unit is one run. Knows what
// is to be run, not how: the caller brings the driver. Pure functions, but for the driver.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/experiment/factorial_plan.hpp"
#include "redag_lab/experiment/observation.hpp"

namespace redag::experiment {

/// A run, ready for a driver.
struct PlannedRun {
  Workload workload;
  std::string executor;  // as drivers name it
  World world = World::Simulator;
  std::uint64_t seed = 0;
  Duration duration = 0;
  Duration warm_up = 0;
  sim::Overheads overheads;
};

/// Any number of threads at once in the simulator's world. Error: the run could not be made.
using Drive = std::function<Result<FinishedRun>(const PlannedRun &run)>;

class Factorial {
 public:
  /// Requires a plan without mistakes.
  Factorial(FactorialPlan plan, Drive drive);

  [[nodiscard]] const FactorialPlan &plan() const { return plan_; }
  [[nodiscard]] const std::vector<Factor> &factors() const { return factors_; }
  [[nodiscard]] const std::vector<FactorialPoint> &points() const { return points_; }
  /// The point of `ideal` with the same jobs and workers; nothing if the plan has none.
  [[nodiscard]] std::optional<std::size_t> ideal_of(std::size_t point) const;
  [[nodiscard]] std::uint64_t unit_count() const { return points_.size() * plan_.repetitions; }

  /// Units are numbered repetition by repetition, so that what an interrupted run has done covers all points.
  [[nodiscard]] std::size_t point_of(std::uint64_t unit) const { return unit % points_.size(); }
  [[nodiscard]] std::uint64_t repetition_of(std::uint64_t unit) const { return unit / points_.size(); }

  /// The jobs of a repetition are the same at all points with this workload and demand: differences are the points'.
  /// Errors: those of generate(); a workload without mean execution time to scale.
  [[nodiscard]] Result<PlannedRun> planned_run(std::uint64_t unit) const;

  /// The unit's result, one line.
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const;

 private:
  [[nodiscard]] Result<Workload> workload_of(const FactorialPoint &point, std::uint64_t repetition) const;

  FactorialPlan plan_;
  Drive drive_;
  std::vector<Factor> factors_;
  std::vector<FactorialPoint> points_;
  std::vector<std::size_t> ideals_;  // points of `ideal`
};

/// Sum over tasks of mean execution time / period: what the paper calls U.
[[nodiscard]] double mean_utilization(const Workload &workload);

}  // namespace redag::experiment
