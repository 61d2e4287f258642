// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The first lines of a report: the results of the runs in sentences that can be quoted. They contain nothing beyond the
// tables. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag_analysis/metrics/verdict.hpp"
#include "redag_lab/report/digest.hpp"

namespace redag::report {

enum class Tone : std::uint8_t { Good, Bad, Caution, Plain };

[[nodiscard]] const char *to_string(Tone tone);

struct Sentence {
  Tone tone = Tone::Plain;
  std::string text;
};

/// Returns the sentences about one group: deadlines, bounds, the trace checker, execution times, disturbances.
[[nodiscard]] std::vector<Sentence> verdict_of(const Group &group);

/// Returns the result in one line, without a period: of one group, whether deadlines were met; of several, which one
/// misses fewest. Requires a group.
[[nodiscard]] Sentence headline_of(std::span<const Group> groups);

/// True if the DAG's longest end-to-end response exceeds its bound by more than an uncalibrated machine may add.
[[nodiscard]] bool is_above_bound(const Group &group, DagId dag);

/// One number over the repetitions.
struct Spread {
  double median = 0;
  double min = 0;
  double max = 0;
};

/// Requires at least one value.
[[nodiscard]] Spread spread_of(std::vector<double> values);

/// Returns the share of missed jobs over the repetitions; of all DAGs together without `dag`.
[[nodiscard]] Spread misses_of(const Group &group, std::optional<DagId> dag);

/// A DAG that all groups have.
struct CommonDag {
  std::string name;
  std::vector<DagId> ids;  // by group
};

/// None for a single group.
[[nodiscard]] std::vector<CommonDag> common_dags(std::span<const Group> groups);

struct Contender {
  std::string name;
  std::uint64_t missed = 0;  // in all repetitions
  std::uint64_t released = 0;
  Spread misses;  // share of a repetition's jobs
};

/// Names the contender that misses fewest and those not clearly different: "redag misses fewest". Ranges that touch do
/// not predict the next repetition. Requires at least one contender.
[[nodiscard]] std::string ranking(std::span<const Contender> contenders);

/// Returns "control: redag misses 0.0043 % (1 of 23 326), mte 14.2 %: redag misses fewest". The shares cover all
/// repetitions together.
[[nodiscard]] std::string comparison_line(const std::string &dag, std::span<const Contender> contenders);

}  // namespace redag::report
