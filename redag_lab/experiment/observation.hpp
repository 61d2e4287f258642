// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What is kept of one run of the experiment "factorial": numbers of each DAG and of all together. Plain values with a
// text form of one line, for the journal.
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

/// Counted or measured in one run; durations in ns. The names of docs/experiments.md. The response of a DAG is end to
/// end, of several sinks figure by figure that of the worst one; all DAGs together have none.
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
  // The paper's accounting (metrics/paper_accounting.hpp): with the true epoch, and with one before start-up.
  PaperJobs,
  PaperLate,
  PaperMaxLateness,
  PaperStartupLate,
  Work,  // time that jobs had a worker, from the end of the warm-up to that of the run
  // At the sink with the smallest share of answers: finishes, and how many its sources' releases asked for.
  Answered,
  AnswersDue,
  EndToEndLate,  // beyond the DAG's end-to-end deadline, at all sinks
};
inline constexpr std::size_t kMeasureCount = 23;
/// The value of what was not there to be measured: the response of a DAG that never answered, the lateness of no job.
inline constexpr std::int64_t kNotMeasured = std::numeric_limits<std::int64_t>::min();
[[nodiscard]] const char *to_string(Measure measure);

/// Of the end-to-end response times, where the plan asks for it.
inline constexpr std::array<double, 25> kQuantiles = {0.5, 1,  2,  5,  10, 15, 20, 25, 30, 35, 40, 45, 50,
                                                      55,  60, 65, 70, 75, 80, 85, 90, 95, 98, 99, 100};

struct DagObservation {
  std::string dag;  // "total" for all together
  std::array<std::int64_t, kMeasureCount> values{};
  std::vector<Duration> quantiles;  // by kQuantiles; empty: not kept, or no job finished

  [[nodiscard]] std::int64_t of(Measure measure) const { return values[static_cast<std::size_t>(measure)]; }
  friend bool operator==(const DagObservation &, const DagObservation &) = default;
};

struct Observation {
  std::uint64_t seed = 0;
  std::string world;       // of this run: ideal executors are always simulated
  std::string preemption;  // mode that ran
  std::uint32_t workers = 0;
  std::uint64_t violations = 0;      // of the trace checker
  bool enforced = true;              // no DAG ever had more jobs in progress than its max_active
  std::uint64_t check_count = 0;     // checks that the trace checker made
  std::vector<DagObservation> dags;  // the last is the total

  friend bool operator==(const Observation &, const Observation &) = default;
};

/// A finished run, as drivers hand it over.
struct FinishedRun {
  trace::Trace trace;  // all of it
  metrics::Summary summary;
  metrics::CheckReport check;
};

struct ObserveOptions {
  Duration paper_startup = 0;
  bool quantiles = false;
};
[[nodiscard]] Observation observe(const FinishedRun &run, const ObserveOptions &options);

/// One line. parse_observation() gives the observation back; error: not of this form.
[[nodiscard]] std::string to_line(const Observation &observation);
[[nodiscard]] Result<Observation> parse_observation(std::string_view line);

}  // namespace redag::experiment
