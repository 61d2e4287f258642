// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A report's first lines: what the runs showed, in sentences that can be quoted. Everything here is also in the tables;
// nothing is here that they do not say. Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "redag_analysis/metrics/verdict.hpp"
#include "redag_lab/report/digest.hpp"

namespace redag::report {

using metrics::join;

enum class Tone : std::uint8_t { Good, Bad, Caution, Plain };

[[nodiscard]] const char *to_string(Tone tone);

struct Sentence {
  Tone tone = Tone::Plain;
  std::string text;
};

/// Of one group: deadlines, bounds, the trace checker, execution times, what disturbs its figures.
[[nodiscard]] std::vector<Sentence> verdict_of(const Group &group);

/// Is the longest end-to-end response of the DAG above its bound, by more than a machine that was not calibrated may
/// take?
[[nodiscard]] bool is_above_bound(const Group &group, DagId dag);

/// One number over repetitions.
struct Spread {
  double median = 0;
  double min = 0;
  double max = 0;
};

/// Requires a value.
[[nodiscard]] Spread spread_of(std::vector<double> values);

struct Contender {
  std::string name;
  std::uint64_t missed = 0;  // in all repetitions
  std::uint64_t released = 0;
  Spread misses;  // share of a repetition's jobs
};

/// Who misses fewest, and who cannot be told from that: "redag misses fewest". Ranges that touch say nothing about the
/// next repetition. Requires a contender.
[[nodiscard]] std::string ranking(std::span<const Contender> contenders);

/// "control: redag misses 0.0043 % (1 of 23 326), mte 14.2 %: redag misses fewest"; shares are of all repetitions
/// together.
[[nodiscard]] std::string comparison_line(const std::string &dag, std::span<const Contender> contenders);

/// A sentence for each DAG that all groups have; none for a single group.
[[nodiscard]] std::vector<Sentence> compare(std::span<const Group> groups);

}  // namespace redag::report
