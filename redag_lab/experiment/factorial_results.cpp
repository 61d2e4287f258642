// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial_results.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

namespace redag::experiment {
namespace {

constexpr std::array<const char *, kMetricCount> kNames = {
    "miss_ratio",        "late_ratio",         "drop_ratio",
    "excess_miss_ratio", "paper_miss_ratio",   "paper_startup_miss_ratio",
    "max_lateness",      "paper_max_lateness", "response_mean",
    "response_p50",      "response_p95",       "response_p99",
    "response_max",      "deferred",           "preemptions",
    "peak_active",       "finished_per_s",     "work"};

double ratio(std::int64_t part, std::int64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

// Returns the metric's value; nothing if it was not measured.
std::optional<double> value_of(const DagObservation &seen, Metric metric, Duration counted) {
  const auto per_release = [&](Measure measure) { return ratio(seen.of(measure), seen.of(Measure::Released)); };
  const auto plain = [&](Measure measure) -> std::optional<double> {
    if (seen.of(measure) == kNotMeasured) return std::nullopt;
    return static_cast<double>(seen.of(measure));
  };
  switch (metric) {
    case Metric::MissRatio:
    case Metric::ExcessMissRatio: return per_release(Measure::Missed);
    case Metric::LateRatio: return per_release(Measure::Late);
    case Metric::DropRatio: return per_release(Measure::Dropped);
    case Metric::PaperMissRatio: return ratio(seen.of(Measure::PaperLate), seen.of(Measure::PaperJobs));
    case Metric::PaperStartupMissRatio: return ratio(seen.of(Measure::PaperStartupLate), seen.of(Measure::PaperJobs));
    case Metric::MaxLateness: return plain(Measure::MaxLateness);
    case Metric::PaperMaxLateness: return plain(Measure::PaperMaxLateness);
    case Metric::ResponseMean: return plain(Measure::ResponseMean);
    case Metric::ResponseP50: return plain(Measure::ResponseP50);
    case Metric::ResponseP95: return plain(Measure::ResponseP95);
    case Metric::ResponseP99: return plain(Measure::ResponseP99);
    case Metric::ResponseMax: return plain(Measure::ResponseMax);
    case Metric::Deferred: return per_release(Measure::Deferred);
    case Metric::Preemptions: return per_release(Measure::Preemptions);
    case Metric::PeakActive: return plain(Measure::PeakActive);
    case Metric::FinishedPerSecond:
      return static_cast<double>(seen.of(Measure::Finished)) * kSecond / static_cast<double>(counted);
    case Metric::Work: return static_cast<double>(seen.of(Measure::Work)) / static_cast<double>(counted);
  }
  return 0;
}

Duration counted_of(const Factorial &factorial) { return factorial.plan().duration - factorial.plan().warm_up; }

// Returns the run of that repetition, or null if it is not finished. Runs are in order of their repetition.
const Observation *run_of(const FactorialRow &row, std::uint64_t repetition) {
  const auto at = std::lower_bound(row.repetition.begin(), row.repetition.end(), repetition);
  if (at == row.repetition.end() || *at != repetition) return nullptr;
  return &row.runs()[static_cast<std::size_t>(at - row.repetition.begin())];
}

}  // namespace

const char *to_string(Metric metric) { return kNames[static_cast<std::size_t>(metric)]; }

bool is_duration(Metric metric) {
  switch (metric) {
    case Metric::MaxLateness:
    case Metric::PaperMaxLateness:
    case Metric::ResponseMean:
    case Metric::ResponseP50:
    case Metric::ResponseP95:
    case Metric::ResponseP99:
    case Metric::ResponseMax: return true;
    default: return false;
  }
}

bool is_maximum(Metric metric) {
  switch (metric) {
    case Metric::MaxLateness:
    case Metric::PaperMaxLateness:
    case Metric::ResponseMax:
    case Metric::PeakActive: return true;
    default: return false;
  }
}

FactorialCounter::FactorialCounter(const Factorial &factorial) : factorial_(factorial) {
  const auto log = std::make_shared<ObservationLog>();
  for (std::size_t p = 0; p < factorial.points().size(); ++p) results_.rows.push_back(FactorialRow{p, {}, {}, log});
  results_.units = factorial.unit_count();
}

Result<void> FactorialCounter::add(std::uint64_t unit, const std::string &result) {
  const Result<Observation> seen =
      unit < results_.units ? parse_observation(result) : Result<Observation>(make_error("the plan has no such unit"));
  if (!seen) {
    return make_error(fmt::format("unit {}: {}", unit, seen.error().front().message), kDamagedUnit);
  }
  FactorialRow &row = results_.rows[factorial_.point_of(unit)];
  const Result<ObservationLog::Place> place = row.log->add(result);
  if (!place) return tl::unexpected<Diagnostics>(place.error());
  row.log->forget(row.point);
  const std::uint64_t repetition = factorial_.repetition_of(unit);
  results_.violations += seen->violations;
  results_.checks += seen->check_count;
  if (!seen->enforced) ++results_.unenforced;
  ++results_.done;
  const auto at = std::lower_bound(row.repetition.begin(), row.repetition.end(), repetition);
  row.places.insert(row.places.begin() + (at - row.repetition.begin()), *place);
  row.repetition.insert(at, repetition);
  return {};
}

std::optional<Median> over_runs(const Factorial &factorial, const FactorialResults &results, const FactorialRow &row,
                                std::size_t dag, Metric metric) {
  std::vector<double> values;
  const std::vector<Observation> &runs = row.runs();
  const std::optional<std::size_t> ideal =
      metric == Metric::ExcessMissRatio ? factorial.ideal_of(row.point) : std::nullopt;
  if (metric == Metric::ExcessMissRatio && !ideal) return std::nullopt;
  const Duration counted = counted_of(factorial);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const std::optional<double> value = value_of(runs[r].dags[dag], metric, counted);
    if (!value) continue;
    double above = 0;
    if (ideal) {
      const Observation *best = run_of(results.rows[*ideal], row.repetition[r]);
      if (best == nullptr || best->seed != runs[r].seed) continue;  // recorded runs can have other jobs
      above = *value_of(best->dags[dag], metric, counted);
    }
    values.push_back(*value - above);
  }
  if (values.empty()) return std::nullopt;
  if (!is_maximum(metric)) return median_of(std::move(values));
  const auto [least, largest] = std::minmax_element(values.begin(), values.end());
  return Median{.median = *largest, .low = *least, .high = *largest, .confidence = median_of(values).confidence};
}

std::uint64_t sum_over_runs(const FactorialRow &row, std::size_t dag, Measure measure) {
  std::uint64_t sum = 0;
  for (const Observation &run : row.runs()) sum += static_cast<std::uint64_t>(run.dags[dag].of(measure));
  return sum;
}

std::vector<FactorialEffects> effects_of(const Factorial &factorial, const FactorialResults &results) {
  std::vector<FactorialEffects> all;
  if (!results.complete()) return all;
  const std::vector<Factor> &factors = factorial.factors();
  const std::size_t executors = factorial.plan().executors.size();
  for (std::uint32_t w = 0; w < factorial.plan().workloads.size(); ++w) {
    for (std::uint32_t e = 0; e < executors; ++e) {
      FactorialEffects one;
      one.workload = w;
      one.executor = e;
      std::vector<const FactorialRow *> rows;
      for (const FactorialRow &row : results.rows) {
        const FactorialPoint &point = factorial.points()[row.point];
        if (point.of(FactorKind::Workload) == w && point.of(FactorKind::Executor) == e) rows.push_back(&row);
      }
      std::vector<std::uint32_t> counts;
      for (const Factor &factor : factors) {
        if (factor.kind == FactorKind::Workload || factor.kind == FactorKind::Executor) continue;
        const bool varies =
            factor.levels.size() > 1 && factorial.points()[rows.front()->point].of(factor.kind) != kNoLevel;
        if (!varies) continue;
        one.factors.push_back(factor.kind);
        counts.push_back(static_cast<std::uint32_t>(factor.levels.size()));
      }
      if (one.factors.empty()) continue;
      std::vector<EffectCell> cells;
      for (const FactorialRow *row : rows) {
        EffectCell cell;
        for (const FactorKind kind : one.factors) cell.level.push_back(factorial.points()[row->point].of(kind));
        for (const Observation &run : row->runs())
          cell.results.push_back(*value_of(run.dags.back(), Metric::MissRatio, counted_of(factorial)));
        cells.push_back(std::move(cell));
      }
      one.effects = experiment::effects_of(counts, cells);
      all.push_back(std::move(one));
    }
  }
  return all;
}

namespace {

// Returns the columns that identify a row.
std::string factor_columns() {
  std::string text;
  for (std::size_t f = 0; f < kFactorCount; ++f) text += fmt::format("{},", to_string(static_cast<FactorKind>(f)));
  return text;
}

std::string factor_cells(const Factorial &factorial, std::size_t point) {
  std::string text;
  for (const Factor &factor : factorial.factors()) {
    const std::uint32_t level = factorial.points()[point].of(factor.kind);
    text += (level == kNoLevel ? std::string() : factor.levels[level]) + ",";
  }
  return text;
}

std::string number(double value, Metric metric) {
  return is_duration(metric) ? fmt::format("{:.0f}", value) : fmt::format("{:.6g}", value);
}

}  // namespace

std::string to_csv(const Factorial &factorial, const FactorialResults &results) {
  std::string text = factor_columns() + "world,preemption,dag,repetitions,confidence";
  for (std::size_t m = 0; m < kMetricCount; ++m) {
    const auto metric = static_cast<Metric>(m);
    const std::string name = std::string(to_string(metric)) + (is_duration(metric) ? "_ns" : "");
    text += fmt::format(",{0},{0}_low,{0}_high", name);
  }
  text += "\n";
  for (const FactorialRow &row : results.rows) {
    if (row.repetition.empty()) continue;
    const Observation &first = row.runs().front();
    for (std::size_t dag = 0; dag < first.dags.size(); ++dag) {
      text += fmt::format("{}{},{},{},{}", factor_cells(factorial, row.point), first.world, first.preemption,
                          first.dags[dag].dag, row.repetition.size());
      const std::optional<Median> any = over_runs(factorial, results, row, dag, Metric::MissRatio);
      text += fmt::format(",{:.4g}", any->confidence);
      for (std::size_t m = 0; m < kMetricCount; ++m) {
        const auto metric = static_cast<Metric>(m);
        const std::optional<Median> median = over_runs(factorial, results, row, dag, metric);
        if (median) {
          text += fmt::format(",{},{},{}", number(median->median, metric), number(median->low, metric),
                              number(median->high, metric));
        } else {
          text += ",,,";
        }
      }
      text += "\n";
    }
  }
  return text;
}

void observations_csv(const Factorial &factorial, const FactorialResults &results,
                      const std::function<void(std::string_view)> &write) {
  std::string text = factor_columns() + "repetition,seed,world,preemption,worker_count,violations,enforced,dag";
  for (std::size_t m = 0; m < kMeasureCount; ++m) text += fmt::format(",{}", to_string(static_cast<Measure>(m)));
  text += "\n";
  for (const FactorialRow &row : results.rows) {
    write(text);
    text.clear();
    const std::vector<Observation> &runs = row.runs();
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const Observation &run = runs[r];
      for (const DagObservation &dag : run.dags) {
        text +=
            fmt::format("{}{},{},{},{},{},{},{},{}", factor_cells(factorial, row.point), row.repetition[r], run.seed,
                        run.world, run.preemption, run.workers, run.violations, run.enforced ? 1 : 0, dag.dag);
        for (const std::int64_t value : dag.values) {
          text += value == kNotMeasured ? std::string(",") : fmt::format(",{}", value);
        }
        text += "\n";
      }
    }
  }
  write(text);
}

std::string quantiles_csv(const Factorial &factorial, const FactorialResults &results) {
  std::string text = factor_columns() + "dag,percent,response_ns\n";
  for (const FactorialRow &row : results.rows) {
    if (row.repetition.empty()) continue;
    for (std::size_t dag = 0; dag < row.runs().front().dags.size(); ++dag) {
      for (std::size_t q = 0; q < kQuantiles.size(); ++q) {
        std::vector<double> values;
        for (const Observation &run : row.runs()) {
          if (!run.dags[dag].quantiles.empty()) values.push_back(static_cast<double>(run.dags[dag].quantiles[q]));
        }
        if (values.empty()) continue;
        text += fmt::format("{}{},{},{:.0f}\n", factor_cells(factorial, row.point), row.runs().front().dags[dag].dag,
                            kQuantiles[q], experiment::median_of(std::move(values)).median);
      }
    }
  }
  return text;
}

}  // namespace redag::experiment
