// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A run's trace as files: what the executor's rings give, kept until the end, because only then it is known what the
// events' task ids mean. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/job_event.hpp"
#include "redag/trace/flight_recorder.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

/// Makes a folder, with its parents, that files can be written to. Error: why that is not possible.
[[nodiscard]] redag::Result<void> prepare_folder(const std::string &path);

class TraceKeeper {
 public:
  explicit TraceKeeper(std::size_t most_events) : most_(most_events) {}

  /// Keeps the first ones; of what follows only the fact.
  void add(const std::vector<redag::JobEvent> &events);

  /// summary.json, jobs.csv, trace.json and events.jsonl, as docs/results_format.md has them. After spinning; every
  /// problem there is.
  [[nodiscard]] redag::Diagnostics write(const std::string &folder, const ReDAGExecutor &executor);

  [[nodiscard]] std::size_t size() const { return events_.size(); }
  /// Were there more than could be kept?
  [[nodiscard]] bool is_cut() const { return is_cut_; }

 private:
  std::size_t most_;
  bool is_cut_ = false;
  std::vector<redag::JobEvent> events_;
};

/// A record of the run that outlives the process, in `folder`/flight: `redag recover` makes results of it.
class FlightLog {
 public:
  /// What an earlier process left there is moved aside, to flight.1 and so on; returns where to.
  [[nodiscard]] std::optional<std::string> prepare(const std::string &folder);
  /// Error, once: from here on nothing is recorded.
  [[nodiscard]] redag::Result<void> add(const std::vector<redag::JobEvent> &events, const ReDAGExecutor &executor);
  /// The results are written.
  [[nodiscard]] redag::Result<void> remove();

 private:
  [[nodiscard]] redag::Result<void> describe(const std::vector<redag::JobEvent> &events, const ReDAGExecutor &executor);

  std::string folder_;
  std::optional<redag::trace::FlightRecorder> recorder_;
  std::vector<std::uint32_t> positions_;  // of the tasks that the record describes
  bool learning_ = true;
  bool broken_ = false;
};

}  // namespace redag_rclcpp
