// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The figures kept of one run of the experiment "factorial", by DAG and in total. Plain values with a text form of one
// line, for the store of units.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/check_report.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag::experiment {

/// The response of a DAG is end to end; with several sinks each figure is that of the worst sink. The total has no
/// response. docs/experiments.md describes the figures, which have these names.
enum Figure : std::uint8_t {
  kMissRatio,  // late, dropped or aborted jobs, per release
  kDropRatio,
  kExcessMissRatio,        // above the ideal on the same jobs; not of a run alone
  kPaperMissRatio,         // the paper's accounting (metrics/paper_accounting.hpp): with the true epoch,
  kPaperStartupMissRatio,  // and with an epoch 15 ms before the first release
  kMaxLateness,
  kPaperMaxLateness,
  kResponseP50,
  kResponseP95,
  kResponseP99,
  kResponseMax,
  kFinishedPerSecond,  // jobs per second of counted time
  kWork,               // time with a worker, per counted time: processors in use
};
inline constexpr std::array kFigureNames = {"miss_ratio",
                                            "drop_ratio",
                                            "excess_miss_ratio",
                                            "paper_miss_ratio",
                                            "paper_startup_miss_ratio",
                                            "max_lateness_ns",
                                            "paper_max_lateness_ns",
                                            "response_p50_ns",
                                            "response_p95_ns",
                                            "response_p99_ns",
                                            "response_max_ns",
                                            "finished_per_s",
                                            "work"};
inline constexpr std::size_t kFigureCount = kFigureNames.size();

struct DagObservation {
  std::string dag;  // "total" for all DAGs together
  std::uint64_t released = 0;
  std::uint64_t missed = 0;
  std::array<std::optional<double>, kFigureCount> figures;  // nothing where there is nothing to measure

  friend bool operator==(const DagObservation &, const DagObservation &) = default;
};

struct Observation {
  std::string world;                 // of this run; ideal executors are always simulated
  std::string preemption;            // the mode that ran
  std::uint64_t violations = 0;      // found by the trace checker
  std::uint64_t checks = 0;          // made by the trace checker
  bool enforced = true;              // no DAG ever exceeded its max_active
  std::vector<DagObservation> dags;  // the last is the total

  friend bool operator==(const Observation &, const Observation &) = default;
};

/// A finished run, as drivers return it.
struct FinishedRun {
  trace::Trace trace;  // the whole run
  metrics::Summary summary;
  metrics::CheckReport check;
};

[[nodiscard]] Observation observe(const FinishedRun &run);

/// Returns the observation as one line, from which parse_observation() restores it. Parsing fails on any other form.
[[nodiscard]] std::string to_line(const Observation &observation);
[[nodiscard]] Result<Observation> parse_observation(std::string_view line);

}  // namespace redag::experiment
