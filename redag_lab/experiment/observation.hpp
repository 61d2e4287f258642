// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The figures kept of one run of the experiment "factorial", by DAG and in total. Plain values with a text form of one
// line, for units.db.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check_report.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag::experiment {

/// Counts and measurements of one run; durations are in ns. The names are those of docs/experiments.md. The response of
/// a DAG is end to end; with several sinks each figure is that of the worst sink. The total has no response.
enum class Measure : std::uint8_t {
  Released,
  Finished,
  Late,
  Dropped,  // skipped releases
  Aborted,
  Missed,  // late, dropped or aborted (metrics::JobCounts::missed)
  Deferred,
  Preemptions,
  MaxLateness,
  ResponseMean,
  ResponseP50,
  ResponseP95,
  ResponseP99,
  ResponseMax,
  PeakActive,
  // The paper's accounting (metrics/paper_accounting.hpp): with the true epoch, and with an epoch before start-up.
  PaperJobs,
  PaperLate,
  PaperMaxLateness,
  PaperStartupLate,
  Work,  // time that jobs had a worker, from the end of the warm-up to the end of the run
  // Of the sink with the smallest share of answers: its finished jobs, and the number that its sources' releases
  // require.
  Answered,
  AnswersDue,
  EndToEndLate,  // beyond the DAG's end-to-end deadline, over all sinks
};
inline constexpr std::size_t kMeasureCount = 23;
/// Marks a value that could not be measured: the response of a DAG that never answered, or the lateness without a job.
inline constexpr std::int64_t kNotMeasured = std::numeric_limits<std::int64_t>::min();
[[nodiscard]] const char *to_string(Measure measure);

/// Percentages of the quantiles of end-to-end responses, kept where the plan asks for them.
inline constexpr std::array<double, 25> kQuantiles = {0.5, 1,  2,  5,  10, 15, 20, 25, 30, 35, 40, 45, 50,
                                                      55,  60, 65, 70, 75, 80, 85, 90, 95, 98, 99, 100};

struct DagObservation {
  std::string dag;  // "total" for all DAGs together
  std::array<std::int64_t, kMeasureCount> values{};
  std::vector<Duration> quantiles;  // by kQuantiles; empty if not kept, or if no job finished

  [[nodiscard]] std::int64_t of(Measure measure) const { return values[static_cast<std::size_t>(measure)]; }
  friend bool operator==(const DagObservation &, const DagObservation &) = default;
};

struct Observation {
  std::uint64_t seed = 0;
  std::string world;       // of this run; ideal executors are always simulated
  std::string preemption;  // the mode that ran
  std::uint32_t workers = 0;
  std::uint64_t violations = 0;      // found by the trace checker
  bool enforced = true;              // no DAG ever exceeded its max_active
  std::uint64_t check_count = 0;     // made by the trace checker
  std::vector<DagObservation> dags;  // the last is the total

  friend bool operator==(const Observation &, const Observation &) = default;
};

/// A finished run, as drivers return it.
struct FinishedRun {
  trace::Trace trace;  // the whole run
  metrics::Summary summary;
  metrics::CheckReport check;
};

struct ObserveOptions {
  Duration paper_startup = 0;
  bool quantiles = false;
};
[[nodiscard]] Observation observe(const FinishedRun &run, const ObserveOptions &options);

/// Returns the observation as one line, from which parse_observation() restores it. Parsing fails on any other form.
[[nodiscard]] std::string to_line(const Observation &observation);
[[nodiscard]] Result<Observation> parse_observation(std::string_view line);

}  // namespace redag::experiment
