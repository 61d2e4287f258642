// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes and reads jobs.csv: a row per job, for spreadsheets and data frames. Columns: docs/results_format.md. Pure
// except for the file.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

/// The first line of the file.
[[nodiscard]] std::string_view jobs_csv_header();

[[nodiscard]] Result<void> write_jobs_csv(const std::string &path, const Workload &workload,
                                          std::span<const JobRecord> jobs);

/// Reads what write_jobs_csv() wrote, and looks up DAGs and tasks by name in `workload`. Derived columns are ignored.
/// Errors name file and line.
[[nodiscard]] Result<std::vector<JobRecord>> read_jobs_csv(const std::string &path, const Workload &workload);

/// Parses text in memory in the same way; errors call it `file`.
[[nodiscard]] Result<std::vector<JobRecord>> parse_jobs_csv(std::string_view text, const std::string &file,
                                                            const Workload &workload);

}  // namespace redag::metrics
