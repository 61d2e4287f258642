// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes jobs.csv: a row per job, for spreadsheets and data frames. Columns: docs/results_format.md. Pure
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

}  // namespace redag::metrics
