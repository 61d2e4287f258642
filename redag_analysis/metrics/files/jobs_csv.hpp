// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes and reads jobs.csv: a row per job, for spreadsheets and data frames. Columns: docs/results_format.md. Pure
// except for the file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

/// Quotes a field by RFC 4180, if it needs quotes.
[[nodiscard]] std::string csv_quoted(const std::string &text);

/// The fields "dag,task" by TaskId.
[[nodiscard]] std::vector<std::string> csv_task_names(const Workload &workload);

/// The first line of the file.
[[nodiscard]] std::string_view jobs_csv_header();

/// Writes the jobs of a run while it goes on. Rows are in order of release. Only where more than kMostHeldJobs jobs
/// have ended since a job was released that still has not, they are written before it, so that memory stays bounded.
class JobsCsvWriter {
 public:
  static constexpr std::size_t kMostHeldJobs = std::size_t{1} << 18U;

  /// Error: an unwritable place.
  [[nodiscard]] static Result<JobsCsvWriter> create(const std::string &path, const Workload &workload,
                                                    std::size_t most_held = kMostHeldJobs);

  /// Continues from the last call.
  void add(std::span<const JobEvent> events);

  /// Writes the jobs in flight, and completes the file. Until then it does not exist.
  [[nodiscard]] Result<void> commit();

 private:
  JobsCsvWriter(trace::OutputFile file, const Workload &workload, std::size_t most_held);

  void hold(const JobRecord &job);
  void write_first();

  trace::OutputFile file_;
  std::vector<std::string> names_;  // by TaskId
  JobFolder folder_;
  std::vector<JobRecord> held_;  // a heap: the one that was released first is at the front
  std::size_t most_held_;
  std::uint64_t next_ = 0;  // the sequence number of the row that is due
};

/// Writes all jobs, in the given order.
[[nodiscard]] Result<void> write_jobs_csv(const std::string &path, const Workload &workload,
                                          std::span<const JobRecord> jobs);

/// Reads what write_jobs_csv() wrote, and looks up DAGs and tasks by name in `workload`. Derived columns are ignored.
/// Errors name file and line.
[[nodiscard]] Result<std::vector<JobRecord>> read_jobs_csv(const std::string &path, const Workload &workload);

/// Parses text in memory in the same way; errors call it `file`.
[[nodiscard]] Result<std::vector<JobRecord>> parse_jobs_csv(std::string_view text, const std::string &file,
                                                            const Workload &workload);

}  // namespace redag::metrics
