// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Several executors on one workload, as a table.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag_rclcpp::lab {

/// Summaries of one executor's repetitions; each has one entry for each DAG.
using Repetitions = std::vector<std::vector<redag::metrics::DagSummary>>;

/// One line for each DAG and executor: jobs, misses and end-to-end responses over all repetitions.
[[nodiscard]] std::string comparison_table(const redag::Workload &workload, const std::vector<std::string> &executors,
                                           const std::map<std::string, Repetitions> &results);

}  // namespace redag_rclcpp::lab
