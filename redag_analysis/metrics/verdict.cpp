// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/verdict.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::metrics {
namespace {

// Lists only what occurred: "3 late, 2 skipped".
std::string how_missed(const JobCounts &jobs) {
  std::vector<std::string> parts;
  if (jobs.late > 0) parts.push_back(format_count(jobs.late) + " late");
  if (jobs.skipped > 0) parts.push_back(format_count(jobs.skipped) + " skipped");
  if (jobs.aborted > jobs.no_data()) parts.push_back(format_count(jobs.aborted - jobs.no_data()) + " aborted");
  return join(parts);
}

// An example: "control 12.0 %, b 0.0043 % (1 of 23 326) and 3 other DAGs, the other one none".
std::string by_dag(std::span<const DagSummary> dags) {
  std::vector<std::string> where;
  std::size_t clean = 0;
  for (const DagSummary &dag : dags) {
    if (dag.jobs.missed() == 0) {
      ++clean;
    } else {
      where.push_back(dag.name + " " + format_share(dag.jobs.missed(), dag.jobs.released));
    }
  }
  constexpr std::size_t kMostNamed = 4;
  if (where.size() > kMostNamed) {
    const std::size_t more = where.size() - kMostNamed;
    where.resize(kMostNamed);
    where.push_back(plural(more, "other DAG"));
  }
  if (clean == 0) return join(where);
  return join(where) + (clean == 1 ? ", none in the other one" : fmt::format(", none in the other {}", clean));
}

// An example: " End to end, control was late 5 times of 1 000 (2ms)."
std::string late_end_to_end(std::span<const DagSummary> dags) {
  std::vector<std::string> parts;
  for (const DagSummary &dag : dags) {
    const EndToEnd &end_to_end = dag.end_to_end;
    if (end_to_end.late == 0) continue;
    parts.push_back(fmt::format("{} exceeded its deadline of {} {} of {} times", dag.name,
                                humanize_duration(end_to_end.deadline), format_count(end_to_end.late),
                                format_count(std::max(end_to_end.late, end_to_end.response.count))));
  }
  return parts.empty() ? std::string() : " End to end, " + join(parts) + ".";
}

}  // namespace

bool has_misses(const JobCounts &total, std::span<const DagSummary> dags) {
  return total.missed() > 0 ||
         std::any_of(dags.begin(), dags.end(), [](const DagSummary &dag) { return dag.end_to_end.late > 0; });
}

DeadlineVerdict deadline_verdict(const JobCounts &total, std::span<const DagSummary> dags) {
  const auto verdict = [](bool is_judged, bool is_met, std::string headline, const std::string &rest) {
    std::string text = headline + ": " + rest;
    return DeadlineVerdict{is_judged, is_met, std::move(headline), std::move(text)};
  };
  if (total.released == 0) return verdict(false, false, "No job was released", "there is no verdict.");
  const std::uint64_t missed = total.missed();
  if (missed > 0) {
    const double share = static_cast<double>(missed) / static_cast<double>(total.released);
    return verdict(true, false,
                   fmt::format("{} of {} missed their deadline ({})", format_count(missed),
                               plural(total.released, "job"), format_percent(share)),
                   fmt::format("{}. By DAG: {}.{}", how_missed(total), by_dag(dags), late_end_to_end(dags)));
  }
  const std::string open = total.in_flight > 0 ? fmt::format(" ({} still in progress)", total.in_flight) : "";
  const std::string jobs = fmt::format("{}{}, none late, none lost.", plural(total.released, "job"), open);
  if (!has_misses(total, dags)) return verdict(true, true, "Every deadline was met", jobs);
  return verdict(true, false, "Every job met its own deadline, but end-to-end deadlines were missed",
                 jobs + late_end_to_end(dags));
}

}  // namespace redag::metrics
