// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The experiment "factorial": every executor on every combination of the factors' levels. A unit is one run. The class
// plans the runs and the caller provides the driver that executes them. Pure functions, apart from the driver.
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
  std::string executor;  // the name that drivers use
  World world = World::Simulator;
  std::uint64_t seed = 0;
  Duration duration = 0;
  Duration warm_up = 0;
  sim::Overheads overheads;
};

/// Executes a run. In the simulator's world several threads may call it at once. Error: the run failed to execute.
using Drive = std::function<Result<FinishedRun>(const PlannedRun &run)>;

class Factorial {
 public:
  /// Requires a plan without mistakes.
  Factorial(FactorialPlan plan, Drive drive);

  [[nodiscard]] const FactorialPlan &plan() const { return plan_; }
  [[nodiscard]] const std::vector<Factor> &factors() const { return factors_; }
  [[nodiscard]] const std::vector<FactorialPoint> &points() const { return points_; }
  /// Returns the point of `ideal` with the same jobs and workers; nothing if the plan has none.
  [[nodiscard]] std::optional<std::size_t> ideal_of(std::size_t point) const;
  [[nodiscard]] std::uint64_t unit_count() const { return points_.size() * plan_.repetitions; }

  /// Units are numbered repetition by repetition. An interrupted run has therefore covered all points evenly.
  [[nodiscard]] std::size_t point_of(std::uint64_t unit) const { return unit % points_.size(); }
  [[nodiscard]] std::uint64_t repetition_of(std::uint64_t unit) const { return unit / points_.size(); }

  /// Prepares a unit's run. A repetition has the same jobs at all points with one workload and demand; differences are
  /// due to the points. Errors: those of generate(), and a workload without mean execution time to scale.
  [[nodiscard]] Result<PlannedRun> planned_run(std::uint64_t unit) const;

  /// Returns the unit's result, one line.
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const;

 private:
  [[nodiscard]] Result<Workload> workload_of(const FactorialPoint &point, std::uint64_t repetition) const;

  FactorialPlan plan_;
  Drive drive_;
  std::vector<Factor> factors_;
  std::vector<FactorialPoint> points_;
  std::vector<std::size_t> ideals_;  // indices of the points of `ideal`
};

/// Returns the sum over tasks of mean execution time / period, the U of the paper.
[[nodiscard]] double mean_utilization(const Workload &workload);

}  // namespace redag::experiment
