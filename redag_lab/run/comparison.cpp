// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/comparison.hpp"

#include <algorithm>

#include "redag_analysis/metrics/verdict.hpp"

namespace redag::lab {
namespace {

template <class Value>
Spread spread_over(const ExecutorResults &results, std::size_t dag, Value value) {
  std::vector<double> values;
  for (const auto &repetition : results.repetitions) values.push_back(static_cast<double>(value(repetition[dag])));
  return report::spread_of(std::move(values));
}

}  // namespace

void ExecutorResults::add(const Session &session) {
  std::vector<metrics::DagSummary> seen = session.summary.dags;
  seen.push_back({.name = "total", .jobs = session.summary.total, .end_to_end = {}});
  repetitions.push_back(std::move(seen));
  preemption = session.info.preemption;
  preemption_why = session.info.preemption_why;
  realtime = session.realtime_threads;
  check_violations += session.check.violation_count;
  for (const std::string &warning : session.warnings) {
    if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end()) warnings.push_back(warning);
  }
}

Spread ExecutorResults::miss(std::size_t dag) const {
  return spread_over(*this, dag, [](const metrics::DagSummary &seen) { return seen.jobs.miss_ratio_with_lost(); });
}

Spread ExecutorResults::late(std::size_t dag) const {
  return spread_over(*this, dag, [](const metrics::DagSummary &seen) { return seen.jobs.miss_ratio(); });
}

std::optional<Spread> ExecutorResults::end_to_end(std::size_t dag, Duration metrics::Distribution::*percentile) const {
  std::vector<double> values;
  for (const auto &repetition : repetitions) {
    const metrics::Distribution &response = repetition[dag].end_to_end.response;
    if (response.count > 0) values.push_back(static_cast<double>(response.*percentile));
  }
  if (values.empty()) return std::nullopt;
  return report::spread_of(std::move(values));
}

std::optional<Duration> ExecutorResults::longest_end_to_end(std::size_t dag) const {
  std::optional<Duration> longest;
  for (const auto &repetition : repetitions) {
    const metrics::Distribution &response = repetition[dag].end_to_end.response;
    if (response.count > 0) longest = std::max(longest.value_or(response.max), response.max);
  }
  return longest;
}

std::uint64_t ExecutorResults::late_end_to_end(std::size_t dag) const {
  std::uint64_t late = 0;
  for (const auto &repetition : repetitions) late += repetition[dag].end_to_end.late;
  return late;
}

metrics::JobCounts ExecutorResults::jobs(std::size_t dag) const {
  metrics::JobCounts all;
  for (const auto &repetition : repetitions) all.add_counts(repetition[dag].jobs);
  return all;
}

bool ExecutorResults::has_misses() const {
  return std::any_of(repetitions.begin(), repetitions.end(),
                     [](const auto &dags) { return metrics::has_misses(dags.back().jobs, dags); });
}

}  // namespace redag::lab
