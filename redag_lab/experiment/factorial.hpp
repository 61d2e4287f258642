// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The experiment "factorial": every executor on every combination of the factors' levels, repeated. A unit is one run,
// which a driver of the caller executes. Pure functions, apart from the driver.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/loader/workload_yaml_tree.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/experiment/experiment.hpp"
#include "redag_lab/experiment/observation.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::experiment {

/// Where a run happens.
enum class World : std::uint8_t {
  Simulator,
  Threads,
  Ros2,  // nodes on rclcpp's executors or ours: run_workload of redag_rclcpp
};
[[nodiscard]] const char *to_string(World world);

/// Returns the executors of a world.
using ExecutorNames = std::function<std::vector<std::string>(World)>;

/// Executors besides those of the drivers, always simulated and without overheads. `ideal` is ReDAG-RT, fully
/// preemptive, without max_active. `unlimited` is the same with a worker for every job; no job ever waits for a worker.
inline constexpr std::string_view kIdeal = "ideal";
inline constexpr std::string_view kUnlimited = "unlimited";

/// A fixed workload, or the options from which each repetition draws another one.
struct WorkloadSource {
  std::string name;
  Workload workload;
  std::optional<lab::GenerateOptions> random;
};

/// Numbers with a fraction are in millionths (kMillion is 1). An empty list means the workload's own value.
struct FactorialPlan {
  std::string name = "factorial";
  World world = World::Simulator;
  std::uint64_t seed = 1;
  std::uint32_t repetitions = 1;
  Duration duration = 10 * kSecond;
  Duration warm_up = 0;
  sim::Overheads overheads;  // simulator; ideal and unlimited have none
  // The factors, in the order of the columns.
  std::vector<WorkloadSource> workloads;
  std::vector<PolicyKind> policies;
  std::vector<std::uint32_t> workers;
  std::vector<std::uint32_t> utilization;     // per worker, of mean execution times, which are scaled to it
  std::vector<std::uint32_t> demand_scale;    // factors on execution times
  std::vector<std::uint32_t> deadline_scale;  // factors on relative deadlines
  /// By DAG; 0: no bound. A single number applies to all DAGs.
  std::vector<std::vector<std::uint32_t>> max_active;
  std::vector<std::string> executors;
};
/// Reads a plan, and the workload files that it names, relative to the folder of `file`. Errors: every mistake with its
/// place.
[[nodiscard]] Result<FactorialPlan> read_factorial_plan(const yaml::Node &root, const std::string &file,
                                                        const ExecutorNames &executors);

/// An executor as plans write it: "mte" runs in the plan's world, "ros2/mte" in the world ros2.
struct ExecutorPlace {
  World world = World::Simulator;
  std::string name;
};
[[nodiscard]] ExecutorPlace place_of(const FactorialPlan &plan, const std::string &executor);

/// The factors, in the order of factors_of().
enum FactorPlace : std::size_t {
  kWorkload,
  kPolicy,
  kWorkers,
  kUtilization,
  kDemandScale,
  kDeadlineScale,
  kMaxActive,
  kExecutor,
};
[[nodiscard]] std::vector<Factor> factors_of(const FactorialPlan &plan);
/// Returns the combinations. The executor is innermost: on a real machine the compared executors then take turns. A
/// factor does not affect every executor: rclcpp's ignore policies and max_active.
[[nodiscard]] std::vector<Point> points_of(const FactorialPlan &plan);

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

class Factorial final : public Experiment {
 public:
  /// Requires a plan without mistakes.
  Factorial(FactorialPlan plan, Drive drive);

  [[nodiscard]] const std::vector<Point> &points() const { return points_; }
  [[nodiscard]] std::uint64_t unit_count() const override { return points_.size() * plan_.repetitions; }
  [[nodiscard]] bool takes_turns() const override;
  /// Rotates the executors: none always runs first, when the machine is coldest or quietest.
  void arrange(std::vector<std::uint64_t> &units) const override;
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const override;
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result) override;
  [[nodiscard]] Result<Results> results() const override;

  /// Prepares a unit's run. A repetition has the same jobs at all points with one workload and demand; differences are
  /// due to the points. Errors: those of generate(), and a workload without mean execution time to scale.
  [[nodiscard]] Result<PlannedRun> planned_run(std::uint64_t unit) const;

 private:
  /// The finished runs of a point, by repetition.
  using Runs = std::vector<std::optional<Observation>>;

  [[nodiscard]] Result<Workload> workload_of(const Point &point, std::uint64_t repetition) const;
  [[nodiscard]] const Runs *ideal_of(const Point &point) const;
  [[nodiscard]] ResultRow row_of(std::size_t point, std::size_t dag, const Runs *ideal) const;

  FactorialPlan plan_;
  Drive drive_;
  std::vector<Factor> factors_;
  std::vector<Point> points_;
  std::vector<Runs> runs_;  // by point
};

/// Returns the sum over tasks of mean execution time / period, the U of the paper.
[[nodiscard]] double mean_utilization(const Workload &workload);

}  // namespace redag::experiment
