// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes the trace of a run as files. TraceKeeper holds the events until the end, because only then the meaning of
// their task ids is known. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/job_event.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/files/run_files.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

/// Creates a folder with its parents, and checks that it is writable. Error: the reason why not.
[[nodiscard]] redag::Result<void> prepare_folder(const std::string &path);

class TraceKeeper {
 public:
  explicit TraceKeeper(std::size_t most_events) : most_(most_events) {}

  /// Keeps events until `most_events` is reached. Later events only set is_cut().
  void add(const std::vector<redag::JobEvent> &events);

  /// Writes summary.json, jobs.csv, the events, and the picture if there is to be one (docs/results_format.md). Call it
  /// after spinning. Returns all problems.
  [[nodiscard]] redag::Diagnostics write(const redag::metrics::FilesOptions &files, const ReDAGExecutor &executor);

  /// The names of the files that were written: "summary.json, jobs.csv, events.redag".
  [[nodiscard]] const std::string &names() const { return names_; }

  [[nodiscard]] std::size_t size() const { return events_.size(); }
  /// True if there were more events than could be kept.
  [[nodiscard]] bool is_cut() const { return is_cut_; }

 private:
  std::size_t most_;
  bool is_cut_ = false;
  std::string names_;
  std::vector<redag::JobEvent> events_;
};

/// Records the run in events.redag, which outlives the process. The results replace it at the end.
class RunRecord {
 public:
  /// Moves the record of an earlier process aside, to events.1.redag and so on. Returns the new path, or nothing.
  [[nodiscard]] std::optional<std::string> prepare(const std::string &folder);
  /// Appends events, and describes the run again if its tasks or its deadlocks have changed. An error is returned only
  /// once; afterwards nothing is recorded.
  [[nodiscard]] redag::Result<void> add(const std::vector<redag::JobEvent> &events, const ReDAGExecutor &executor);

 private:
  [[nodiscard]] redag::Result<void> describe(const std::vector<redag::JobEvent> &events, const ReDAGExecutor &executor);

  std::string path_;
  std::optional<redag::trace::EventsWriter> file_;
  std::vector<std::uint32_t> positions_;  // positions of the tasks that the record describes
  bool learning_ = true;
  redag::Time deadlocks_ = 0;  // when the deadlocks in the description have changed last
  bool broken_ = false;
};

}  // namespace redag_rclcpp
