// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The results of the experiment "factorial": observations of runs become medians with confidence intervals, distances
// to the ideal, effects of the factors; and files. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/effects.hpp"
#include "redag_lab/experiment/factorial.hpp"
#include "redag_lab/experiment/median.hpp"
#include "redag_lab/experiment/observation.hpp"

namespace redag::experiment {

/// What is told of each DAG at each point, beside the counts: ratios in [0, 1], durations in ns.
enum class Metric : std::uint8_t {
  MissRatio,  // late, dropped or aborted, of all releases
  LateRatio,
  DropRatio,
  ExcessMissRatio,  // above the ideal's on the same jobs
  PaperMissRatio,
  PaperStartupMissRatio,
  MaxLateness,
  PaperMaxLateness,
  ResponseMean,
  ResponseP50,
  ResponseP95,
  ResponseP99,
  ResponseMax,
  Deferred,  // jobs, of all releases
  Preemptions,
  PeakActive,
  FinishedPerSecond,  // jobs, of the time that counts
  Work,               // time that jobs had a worker, by that time: processors in use
};
inline constexpr std::size_t kMetricCount = 18;
[[nodiscard]] const char *to_string(Metric metric);
/// Durations are in ns.
[[nodiscard]] bool is_duration(Metric metric);
/// Of such a metric the largest of all repetitions is told, not their median.
[[nodiscard]] bool is_maximum(Metric metric);

struct FactorialRow {
  std::size_t point = 0;
  std::vector<Observation> runs;          // finished ones
  std::vector<std::uint64_t> repetition;  // by run
};

/// How the miss ratio of one executor on one workload depends on the factors.
struct FactorialEffects {
  std::uint32_t workload = 0;  // level
  std::uint32_t executor = 0;
  std::vector<FactorKind> factors;  // that vary, as in `effects`
  Effects effects;
};

struct FactorialResults {
  std::vector<FactorialRow> rows;  // by point
  std::uint64_t units = 0;
  std::uint64_t done = 0;
  std::uint64_t violations = 0;  // of the trace checker, in all runs
  std::uint64_t checks = 0;
  std::uint64_t unenforced = 0;  // runs in which a DAG exceeded its max_active

  [[nodiscard]] bool complete() const { return done == units; }
};

class FactorialCounter {
 public:
  explicit FactorialCounter(const Factorial &factorial);

  /// Error: a unit or a result that the plan does not have.
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result);
  [[nodiscard]] const FactorialResults &results() const { return results_; }

 private:
  const Factorial &factorial_;
  FactorialResults results_;
};

/// Of DAG number `dag` of the row: the median over the runs and its confidence interval; of a maximum the largest of
/// all runs, with the least and the largest. Nothing where no run is finished, nothing was measured (the response of
/// all DAGs together, or of one that never answered), or there is no ideal to compare with.
[[nodiscard]] std::optional<Median> over_runs(const Factorial &factorial, const FactorialResults &results,
                                              const FactorialRow &row, std::size_t dag, Metric metric);

/// Jobs of DAG number `dag`, of all runs of the row. Requires a count.
[[nodiscard]] std::uint64_t sum_over_runs(const FactorialRow &row, std::size_t dag, Measure measure);

/// For every workload and executor with factors that vary; empty while runs are missing.
[[nodiscard]] std::vector<FactorialEffects> effects_of(const Factorial &factorial, const FactorialResults &results);

/// A row per point and DAG; a row per run and DAG; a row per point, DAG and quantile. The same bytes for the same
/// units.
[[nodiscard]] std::string to_csv(const Factorial &factorial, const FactorialResults &results);
[[nodiscard]] std::string observations_csv(const Factorial &factorial, const FactorialResults &results);
[[nodiscard]] std::string quantiles_csv(const Factorial &factorial, const FactorialResults &results);
/// `runs`: JSON texts (folder.hpp).
[[nodiscard]] std::string to_json(const Factorial &factorial, const FactorialResults &results,
                                  const std::vector<std::string> &runs);
/// A panel for each factor that varies: the mean miss ratio at its levels, over all others, a line for each executor.
[[nodiscard]] std::string to_svg(const Factorial &factorial, const FactorialResults &results);
/// A panel for each DAG at each combination (the first dozen): the distribution of responses, a line for each executor.
[[nodiscard]] std::string responses_svg(const Factorial &factorial, const FactorialResults &results);
/// Misses above the ideal's over utilization, a panel for each combination of the rest (the first dozen), a line for
/// each executor. Nothing where no ideal ran, or utilization does not vary.
[[nodiscard]] std::optional<std::string> distance_svg(const Factorial &factorial, const FactorialResults &results);

/// Writes factorial.csv, .json, .svg, observations.csv, where there is a distance to the ideal over utilization
/// distance.svg, and where the plan asks for quantiles response_quantiles.csv and responses.svg.
[[nodiscard]] Result<void> write_results(const std::string &folder, const Factorial &factorial,
                                         const FactorialResults &results);

}  // namespace redag::experiment
