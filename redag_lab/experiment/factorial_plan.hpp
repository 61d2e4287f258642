// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The plan of the experiment "factorial": every executor on every combination of the factors' levels, repeated.
// docs/experiments.md describes the text form. Plain values; pure functions, apart from the files that
// load_factorial_plan() reads.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/experiment/acceptance_plan.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::experiment {

/// Where a run happens.
enum class World : std::uint8_t {
  Simulator,
  Threads,
  Ros2,  // nodes on rclcpp's executors or ours: run_workload of redag_rclcpp
};

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
  sim::Overheads overheads;                    // simulator; ideal and unlimited have none
  Duration paper_startup = 15 * kMillisecond;  // metrics/paper_accounting.hpp
  bool quantiles = false;                      // keeps the distribution of response times
  // The factors, in the order of the columns.
  std::vector<WorkloadSource> workloads;
  std::vector<std::string> executors;
  std::vector<PolicyKind> policies;
  std::vector<std::uint32_t> workers;
  std::vector<std::uint32_t> utilization;     // per worker, of mean execution times, which are scaled to it
  std::vector<std::uint32_t> demand_scale;    // factors on execution times
  std::vector<std::uint32_t> deadline_scale;  // factors on relative deadlines
  /// By DAG; 0: no bound. A single number applies to all DAGs.
  std::vector<std::vector<std::uint32_t>> max_active;
};

/// An executor as plans write it: "mte" runs in the plan's world, "ros2/mte" in the world ros2.
struct ExecutorPlace {
  World world = World::Simulator;
  std::string name;
};
[[nodiscard]] ExecutorPlace place_of(const FactorialPlan &plan, const std::string &executor);
/// True if some executor of the plan runs in real time, and only one run at a time is possible.
[[nodiscard]] bool needs_machine(const FactorialPlan &plan);

enum class FactorKind : std::uint8_t {
  Workload,
  Policy,
  Workers,
  Utilization,
  DemandScale,
  DeadlineScale,
  MaxActive,
  Executor,
};
inline constexpr std::size_t kFactorCount = 8;
[[nodiscard]] const char *to_string(FactorKind kind);

struct Factor {
  FactorKind kind = FactorKind::Workload;
  std::vector<std::string> levels;  // as displayed
  bool numeric = false;
};

/// Returns the factors by FactorKind. A factor that the plan does not vary has no levels.
[[nodiscard]] std::vector<Factor> factors_of(const FactorialPlan &plan);

/// One combination: a level of each factor, by FactorKind. It is kNoLevel where the plan does not vary the factor, or
/// where the factor does not affect the executor (rclcpp's ignore policies and max_active).
inline constexpr std::uint32_t kNoLevel = std::numeric_limits<std::uint32_t>::max();
struct FactorialPoint {
  std::vector<std::uint32_t> level;

  [[nodiscard]] std::uint32_t of(FactorKind kind) const { return level[static_cast<std::size_t>(kind)]; }
  friend bool operator==(const FactorialPoint &, const FactorialPoint &) = default;
};

/// Returns every combination once, as nested loops in the order of FactorKind. The executor is innermost: on a real
/// machine the compared executors then take turns.
[[nodiscard]] std::vector<FactorialPoint> points_of(const FactorialPlan &plan);

/// Describes a point for messages: "workers 4, executor mte".
[[nodiscard]] std::string describe(const FactorialPlan &plan, const FactorialPoint &point);

[[nodiscard]] std::vector<PlanMistake> find_mistakes(const FactorialPlan &plan, const ExecutorNames &executors);

/// Returns the canonical text, which contains the workloads. Equal plans have equal texts, and parsing restores the
/// plan.
[[nodiscard]] std::string to_yaml(const FactorialPlan &plan);
/// Parses a plan and reads the workload files that it names. Relative names are relative to the folder of `file`.
/// Errors: every mistake with its place.
[[nodiscard]] Result<FactorialPlan> parse_factorial_plan(std::string_view text, const std::string &file,
                                                         const ExecutorNames &executors);
[[nodiscard]] Result<FactorialPlan> load_factorial_plan(const std::string &path, const ExecutorNames &executors);

[[nodiscard]] const char *to_string(World world);

}  // namespace redag::experiment
