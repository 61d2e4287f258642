// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The results of the experiment "factorial": medians with confidence intervals, distances to the ideal, effects of the
// factors, and files. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/effects.hpp"
#include "redag_lab/experiment/factorial.hpp"
#include "redag_lab/experiment/finished_unit.hpp"
#include "redag_lab/experiment/median.hpp"
#include "redag_lab/experiment/observation.hpp"
#include "redag_lab/experiment/observation_log.hpp"

namespace redag::experiment {

/// Figures of each DAG at each point, besides the counts. Ratios are in [0, 1], durations in ns.
enum class Metric : std::uint8_t {
  MissRatio,  // late, dropped or aborted jobs, per release
  LateRatio,
  DropRatio,
  ExcessMissRatio,  // above the ideal on the same jobs
  PaperMissRatio,
  PaperStartupMissRatio,
  MaxLateness,
  PaperMaxLateness,
  ResponseMean,
  ResponseP50,
  ResponseP95,
  ResponseP99,
  ResponseMax,
  Deferred,  // jobs, per release
  Preemptions,
  PeakActive,
  FinishedPerSecond,  // jobs per second of counted time
  Work,               // time with a worker, per counted time: processors in use
};
inline constexpr std::size_t kMetricCount = 18;
[[nodiscard]] const char *to_string(Metric metric);
/// True for metrics in ns.
[[nodiscard]] bool is_duration(Metric metric);
/// True for metrics whose figure is the largest of all repetitions, not their median.
[[nodiscard]] bool is_maximum(Metric metric);

struct FactorialRow {
  std::size_t point = 0;
  std::vector<std::uint64_t> repetition;      // of each finished run, in order
  std::vector<ObservationLog::Place> places;  // of each
  std::shared_ptr<ObservationLog> log;

  /// Returns the finished runs. They stay valid until four other rows are read.
  [[nodiscard]] const std::vector<Observation> &runs() const { return log->read(point, places); }
};

/// How the miss ratio of one executor on one workload depends on the factors.
struct FactorialEffects {
  std::uint32_t workload = 0;  // level
  std::uint32_t executor = 0;
  std::vector<FactorKind> factors;  // those that vary, as in `effects`
  Effects effects;
};

struct FactorialResults {
  std::vector<FactorialRow> rows;  // by point
  std::uint64_t units = 0;
  std::uint64_t done = 0;
  std::uint64_t violations = 0;  // found by the trace checker in all runs
  std::uint64_t checks = 0;
  std::uint64_t unenforced = 0;  // runs in which a DAG exceeded its max_active

  [[nodiscard]] bool complete() const { return done == units; }
};

class FactorialCounter {
 public:
  explicit FactorialCounter(const Factorial &factorial);

  /// Adds a unit. Error: a unit or a result that the plan does not have.
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result);
  [[nodiscard]] const FactorialResults &results() const { return results_; }

 private:
  const Factorial &factorial_;
  FactorialResults results_;
};

/// Returns a metric of DAG number `dag` of the row: the median over the runs and its confidence interval. A maximum is
/// the largest of all runs, with the least and the largest as interval. Returns nothing if no run is finished, nothing
/// was measured, or there is no ideal to compare with. The total and a DAG that never answered have no response.
[[nodiscard]] std::optional<Median> over_runs(const Factorial &factorial, const FactorialResults &results,
                                              const FactorialRow &row, std::size_t dag, Metric metric);

/// Returns the sum of a count of DAG number `dag` over all runs of the row. Requires a measure that counts jobs.
[[nodiscard]] std::uint64_t sum_over_runs(const FactorialRow &row, std::size_t dag, Measure measure);

/// Returns the effects for every workload and executor with factors that vary; empty while runs are missing.
[[nodiscard]] std::vector<FactorialEffects> effects_of(const Factorial &factorial, const FactorialResults &results);

/// Each gives one CSV file: a row per point and DAG; a row per run and DAG, in pieces; a row per point, DAG and
/// quantile. The same units give the same bytes.
[[nodiscard]] std::string to_csv(const Factorial &factorial, const FactorialResults &results);
void observations_csv(const Factorial &factorial, const FactorialResults &results,
                      const std::function<void(std::string_view)> &write);
[[nodiscard]] std::string quantiles_csv(const Factorial &factorial, const FactorialResults &results);
/// `runs` holds JSON texts (folder.hpp).
[[nodiscard]] std::string to_json(const Factorial &factorial, const FactorialResults &results,
                                  const std::vector<std::string> &runs);
/// Draws a panel for each factor that varies, with a line for each executor: the mean miss ratio at each level, over
/// all other factors.
[[nodiscard]] std::string to_svg(const Factorial &factorial, const FactorialResults &results);
/// Draws the distribution of responses: a panel for each DAG at each combination (the first dozen), a line for each
/// executor.
[[nodiscard]] std::string responses_svg(const Factorial &factorial, const FactorialResults &results);
/// Draws the misses above the ideal's over utilization: a panel for each combination of the other factors (the first
/// dozen), a line for each executor. Returns nothing if no ideal ran or utilization does not vary.
[[nodiscard]] std::optional<std::string> distance_svg(const Factorial &factorial, const FactorialResults &results);

/// Writes factorial.csv, .json and .svg, and observations.csv. Writes distance.svg where there is a distance to the
/// ideal over utilization. Writes response_quantiles.csv and responses.svg where the plan asks for quantiles.
[[nodiscard]] Result<void> write_results(const std::string &folder, const Factorial &factorial,
                                         const FactorialResults &results);

}  // namespace redag::experiment
