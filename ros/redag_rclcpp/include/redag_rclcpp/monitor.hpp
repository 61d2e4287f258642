// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Monitor reports what an executor's callbacks do. It publishes diagnostics and a JSON snapshot, offers services for a
// snapshot and for saving the learned workload, and counts responses above their proven bounds. When spinning has
// ended, it writes the result files. It takes no part in scheduling.
//
// Threads: the callbacks of the services run on the executor, in a callback group of their own. Everything else
// (publishing, traces, analysis) happens on the monitor's own thread, at normal priority. That thread costs the workers
// nothing, and it still reports when they are overloaded. The functions may be called from any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "rclcpp/node.hpp"
#include "redag/loader/calibration.hpp"
#include "redag/model/workload.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

struct MonitorOptions {
  std::chrono::nanoseconds period = std::chrono::seconds(1);  // between two published snapshots; 0: only on request
  /// Shows the executor in `redag top` until finish(): a page of shared memory, and a thread that updates it.
  bool live = true;

  /// Folder for events.redag, jobs.csv, summary.json, trace.pftrace and metrics.json; created if missing. "": no files.
  /// Needs ReDAGOptions::trace_capacity.
  std::string trace{};
  std::size_t trace_events = 10'000'000;  // number of first events that are kept, at 32 bytes each

  /// File that ~/save writes; the default of the node's parameter of this name.
  std::string save_path = "redag_workload.yaml";

  /// ReDAGOptions::default_period. A subscription that still has this period learned no rate: the diagnostics count no
  /// misses for it.
  std::chrono::nanoseconds default_period = std::chrono::milliseconds(100);

  /// The executor's workload, for bounds on response times. Empty: no bounds. Counting responses above their bounds
  /// needs ReDAGOptions::trace_capacity.
  std::optional<redag::Workload> workload{};

  /// Overheads of this machine, measured by `redag doctor --measure` and charged to the bounds. Empty: no overheads are
  /// charged.
  std::optional<redag::Calibration> calibration{};
};

/// Declares and reads the parameters of a monitor whose executor gets `executor`: metrics_period, live, save_path,
/// trace, trace_events, bounds, overheads. See options.hpp.
[[nodiscard]] MonitorOptions declare_monitor_options(rclcpp::Node &node, const ReDAGOptions &executor);

class Monitor {
 public:
  /// Creates in `node` the publishers /diagnostics and ~/metrics, and the services ~/metrics and ~/save. The executor
  /// must execute the node and outlive the monitor. Throws std::runtime_error if the folder for results cannot be used.
  Monitor(const rclcpp::Node::SharedPtr &node, ReDAGExecutor &executor, MonitorOptions options = MonitorOptions());
  /// Calls finish() and logs its problems.
  ~Monitor();
  Monitor(const Monitor &) = delete;
  Monitor &operator=(const Monitor &) = delete;

  /// The JSON text that ~/metrics answers ("redag.metrics/1", docs/results_format.md).
  [[nodiscard]] std::string metrics() const;

  /// Writes ReDAGExecutor::learned() as a workload file, without callbacks that never ran and that the workload does
  /// not name. Returns the absolute path, or the problems.
  [[nodiscard]] redag::Result<std::string> save(const std::string &path) const;

  /// Logs a summary and writes the files of the options. Call it when spinning has ended. Later calls do nothing.
  redag::Result<void> finish();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace redag_rclcpp
