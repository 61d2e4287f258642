// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the experiment "factorial" does: every executor on every combination of the factors' levels, repeated. The text
// form is docs/experiments.md. Plain values; pure functions, but for the files that load_factorial_plan() reads.
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

/// Where the runs happen.
enum class World : std::uint8_t {
  Simulator,
  Threads,
  Ros2,  // nodes on rclcpp's executors or ours: run_workload of redag_rclcpp
};

/// The executors that a world has.
using ExecutorNames = std::function<std::vector<std::string>(World)>;

/// Executors beside those of the drivers, always simulated and without overheads. `ideal`: ReDAG-RT, fully preemptive,
/// no max_active. `unlimited`: the same with a worker for every job, so that nobody ever waits.
inline constexpr std::string_view kIdeal = "ideal";
inline constexpr std::string_view kUnlimited = "unlimited";

/// A workload as it was written, or how to draw another one for each repetition.
struct WorkloadSource {
  std::string name;
  Workload workload;
  std::optional<GenerateOptions> random;
};

/// Numbers with a fraction are in millionths (kMillion is 1). An empty list: what the workload says.
struct FactorialPlan {
  std::string name = "factorial";
  World world = World::Simulator;
  std::uint64_t seed = 1;
  std::uint32_t repetitions = 1;
  Duration duration = 10 * kSecond;
  Duration warm_up = 0;
  sim::Overheads overheads;                    // simulator; not of ideal and unlimited
  Duration paper_startup = 15 * kMillisecond;  // metrics/paper_accounting.hpp
  bool quantiles = false;                      // keep the distribution of response times
  // The factors, in the order of the columns.
  std::vector<WorkloadSource> workloads;
  std::vector<std::string> executors;
  std::vector<PolicyKind> policies;
  std::vector<std::uint32_t> workers;
  std::vector<std::uint32_t> utilization;     // per worker, of mean execution times: these are scaled to it
  std::vector<std::uint32_t> demand_scale;    // on execution times
  std::vector<std::uint32_t> deadline_scale;  // on relative deadlines
  /// By DAG, 0: no bound; one number stands for all DAGs.
  std::vector<std::vector<std::uint32_t>> max_active;
};

/// An executor as plans write it: "mte", in the plan's world, or "ros2/mte", in that one.
struct ExecutorPlace {
  World world = World::Simulator;
  std::string name;
};
[[nodiscard]] ExecutorPlace place_of(const FactorialPlan &plan, const std::string &executor);
/// Does any of the plan's executors really run, so that only one can at a time?
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
  std::vector<std::string> levels;  // as people write them
  bool numeric = false;
};

/// By FactorKind. A factor that the plan does not vary has no levels.
[[nodiscard]] std::vector<Factor> factors_of(const FactorialPlan &plan);

/// One combination: a level of each factor, by FactorKind; kNoLevel where the plan does not vary it, or where it means
/// nothing to the executor (rclcpp's know neither policies nor max_active).
inline constexpr std::uint32_t kNoLevel = std::numeric_limits<std::uint32_t>::max();
struct FactorialPoint {
  std::vector<std::uint32_t> level;

  [[nodiscard]] std::uint32_t of(FactorKind kind) const { return level[static_cast<std::size_t>(kind)]; }
  friend bool operator==(const FactorialPoint &, const FactorialPoint &) = default;
};

/// Every combination once: nested loops in the order of FactorKind, the executor innermost, so that on a real machine
/// executors that are compared take turns.
[[nodiscard]] std::vector<FactorialPoint> points_of(const FactorialPlan &plan);

/// "workers 4, executor mte": for messages.
[[nodiscard]] std::string describe(const FactorialPlan &plan, const FactorialPoint &point);

[[nodiscard]] std::vector<PlanMistake> find_mistakes(const FactorialPlan &plan, const ExecutorNames &executors);

/// Canonical text, which holds the workloads themselves: equal plans have equal texts, and parsing gives the plan back.
[[nodiscard]] std::string to_yaml(const FactorialPlan &plan);
/// Workloads that are named by files are read; relative names are relative to the folder of `file`. Errors: every
/// mistake with its place.
[[nodiscard]] Result<FactorialPlan> parse_factorial_plan(std::string_view text, const std::string &file,
                                                         const ExecutorNames &executors);
[[nodiscard]] Result<FactorialPlan> load_factorial_plan(const std::string &path, const ExecutorNames &executors);

[[nodiscard]] const char *to_string(World world);

}  // namespace redag::experiment
