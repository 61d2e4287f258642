// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Generates random workloads from a seed, for experiments and property tests. The same options and seed give the same
// workload on every machine. Pure functions.
#pragma once

#include <array>
#include <cstdint>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"

namespace redag::lab {

enum class PeriodModel : std::uint8_t {
  LogUniform,  // [period_min, period_max], multiples of period_granularity (Emberson, Stafford, Davis, WATERS 2010)
  Harmonic,    // period_min * 2^k up to period_max, equally likely
  Robot,       // 1 to 1000 Hz, the rates common in ROS; the shares are our choice
};

enum class DagShape : std::uint8_t {
  Layered,      // every task but those of the first layer has a predecessor in the layer before
  ErdosRenyi,   // each of the n (n - 1) / 2 forward edges with edge_probability
  ForkJoin,     // one source, parallel tasks, one sink
  Chain,        // one after the other
  Independent,  // no edges
};

enum class RateScope : std::uint8_t {
  PerDag,   // one period and offset for all timer tasks of a DAG
  PerTask,  // each timer task draws its own
};

inline constexpr std::array kPeriodModels = {PeriodModel::LogUniform, PeriodModel::Harmonic, PeriodModel::Robot};
inline constexpr std::array kDagShapes = {DagShape::Layered, DagShape::ErdosRenyi, DagShape::ForkJoin, DagShape::Chain,
                                          DagShape::Independent};

inline constexpr std::uint32_t kMaxTasks = 10'000'000;  // of a generated workload

/// Options of generate(). Shares and ratios are in [0, 1]; ranges include both ends.
struct GenerateOptions {
  std::uint32_t dags = 2;
  std::uint32_t min_tasks = 3;  // per DAG
  std::uint32_t max_tasks = 8;
  std::uint32_t workers = 2;
  PreemptionMode preemption = PreemptionMode::Auto;
  PolicyKind policy = PolicyKind::RateMonotonic;

  double utilization = 1.0;           // of all tasks together
  double max_task_utilization = 1.0;  // of one task

  PeriodModel periods = PeriodModel::LogUniform;
  Duration period_min = 5 * kMillisecond;  // LogUniform, Harmonic
  Duration period_max = 500 * kMillisecond;
  Duration period_granularity = kMillisecond;
  RateScope rates = RateScope::PerDag;
  double deadline_min = 1.0;  // deadline / period, uniform; never below the wcet
  double deadline_max = 1.0;

  DagShape shape = DagShape::Layered;
  double edge_probability = 0.3;  // Layered: of each further edge between neighbouring layers; ErdosRenyi: of each edge
  double data_share = 1.0;        // of the tasks with predecessors: activated by data

  double bcet_min = 1.0;  // bcet / wcet, uniform; below 1 the execution time is uniform in [bcet, wcet]
  double bcet_max = 1.0;
  double jitter = 0.0;               // of a timer task: uniform in [0, jitter * period]
  bool offsets = false;              // timer tasks start at random instants in their first period
  std::uint32_t max_active_min = 0;  // of a DAG; 0: no bound
  std::uint32_t max_active_max = 0;
  std::uint32_t groups = 0;  // number of exclusive groups in the workload
  double group_share = 0.0;  // of the tasks that belong to one of the groups
  double queue_share = 0.0;  // of the tasks with overrun queue, of depth 1 to queue_depth
  std::uint32_t queue_depth = 3;
};

/// Returns the mistakes in the options, each with a message. This is cheap, unlike generate() with large options.
[[nodiscard]] Diagnostics find_mistakes(const GenerateOptions &options);

/// Generates a workload that passes validate() without errors. Its utilization is the target within rounding (each wcet
/// to a nanosecond, at least 1), shared among the tasks by drs(). Errors: options out of range, each with a message.
[[nodiscard]] Result<Workload> generate(const GenerateOptions &options, std::uint64_t seed);

[[nodiscard]] const char *to_string(PeriodModel value);
[[nodiscard]] const char *to_string(DagShape value);

}  // namespace redag::lab
