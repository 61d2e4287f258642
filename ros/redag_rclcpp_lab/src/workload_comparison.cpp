// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "workload_comparison.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <optional>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::Duration;
using redag::metrics::Distribution;

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

// The median of a percentile of the end-to-end response, over the repetitions in which the DAG responded.
std::string percentile_text(const Repetitions &repetitions, std::size_t dag,
                            redag::Duration Distribution::*percentile) {
  std::vector<double> values;
  for (const auto &dags : repetitions) {
    const Distribution &response = dags[dag].end_to_end.response;
    if (response.count > 0) values.push_back(static_cast<double>(response.*percentile));
  }
  return values.empty() ? "-" : redag::humanize_duration(static_cast<Duration>(median(values)));
}

// The largest end-to-end response of all repetitions.
std::string longest_text(const Repetitions &repetitions, std::size_t dag) {
  std::optional<Duration> longest;
  for (const auto &dags : repetitions) {
    const Distribution &response = dags[dag].end_to_end.response;
    if (response.count > 0) longest = std::max(longest.value_or(response.max), response.max);
  }
  return longest ? redag::humanize_duration(*longest) : "-";
}

}  // namespace

std::string comparison_table(const redag::Workload &workload, const std::vector<std::string> &executors,
                             const std::map<std::string, Repetitions> &results) {
  redag::Table table({{"DAG"},
                      {"executor"},
                      {"runs", true},
                      {"jobs", true},
                      {"missed", true},
                      {"lowest", true},
                      {"highest", true},
                      {"p50", true},
                      {"p95", true},
                      {"p99", true},
                      {"max", true}});
  for (std::size_t dag = 0; dag < workload.dags.size(); ++dag) {
    for (const std::string &executor : executors) {
      const auto found = results.find(executor);
      if (found == results.end()) continue;
      const Repetitions &repetitions = found->second;
      redag::metrics::JobCounts jobs;
      std::vector<double> missed;
      for (const auto &dags : repetitions) {
        jobs.add_counts(dags[dag].jobs);
        missed.push_back(dags[dag].jobs.miss_ratio_with_lost());
      }
      const auto [low, high] = std::minmax_element(missed.begin(), missed.end());
      table.add({{workload.dags[dag].name},
                 {executor},
                 {fmt::format("{}", repetitions.size())},
                 {fmt::format("{}", jobs.released)},
                 {redag::format_count_and_share(jobs.missed(), jobs.released)},
                 {redag::format_percent(*low)},
                 {redag::format_percent(*high)},
                 {percentile_text(repetitions, dag, &Distribution::p50)},
                 {percentile_text(repetitions, dag, &Distribution::p95)},
                 {percentile_text(repetitions, dag, &Distribution::p99)},
                 {longest_text(repetitions, dag)}});
    }
  }
  return table.render(0, false);
}

}  // namespace redag_rclcpp::lab
