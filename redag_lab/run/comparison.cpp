// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/comparison.hpp"

#include <algorithm>

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
  std::vector<Observation> seen;
  for (const metrics::DagSummary &dag : session.summary.dags) seen.push_back({dag.jobs, dag.end_to_end});
  seen.push_back({session.summary.total, {}});
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
  return spread_over(*this, dag, [](const Observation &seen) { return seen.jobs.miss_ratio_with_lost(); });
}

Spread ExecutorResults::late(std::size_t dag) const {
  return spread_over(*this, dag, [](const Observation &seen) { return seen.jobs.miss_ratio(); });
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
  const std::size_t total = repetitions.front().size() - 1;
  if (jobs(total).missed() > 0) return true;
  for (std::size_t dag = 0; dag < total; ++dag) {
    if (late_end_to_end(dag) > 0) return true;
  }
  return false;
}

}  // namespace redag::lab
