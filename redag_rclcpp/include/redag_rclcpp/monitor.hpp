// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Says what an executor's callbacks do: diagnostics, a JSON snapshot, services to ask for one and to save what was
// learned, response times above their proven bounds, and result files when spinning has ended. Decides nothing.
//
// Threads: the services' callbacks are a group of their own. All else (snapshots, traces, analysis) is done by a thread
// of its own, at normal priority, so that it costs the workers nothing and is there when they are overloaded. The
// functions may be called from any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include "rclcpp/node.hpp"
#include "redag/model/overheads.hpp"
#include "redag/model/workload.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

struct MonitorOptions {
  std::chrono::nanoseconds period = std::chrono::seconds(1);  // between two snapshots; 0: only when asked for

  /// Folder for events.jsonl, jobs.csv, summary.json, trace.json and metrics.json, made if missing; "": none. Needs
  /// ReDAGOptions::trace_capacity.
  std::string trace{};
  std::size_t trace_events = 10'000'000;  // so many of the first events are kept, at 32 bytes each
  std::string metrics_file{};             // the last snapshot; "": none, save in `trace`

  /// Where ~/save writes to; the default of the node's parameter of this name.
  std::string save_path = "redag_workload.yaml";

  /// ReDAGOptions::default_period: a subscription that has it has no deadline to be held to.
  std::chrono::nanoseconds default_period = std::chrono::milliseconds(100);

  /// What the executor was given, for bounds on response times. None: no bounds. Responses are counted against them
  /// where there is ReDAGOptions::trace_capacity.
  std::optional<redag::Workload> workload{};

  /// What `redag calibrate` measured of this machine, charged to these bounds; none: nothing is charged.
  std::optional<redag::Calibration> calibration{};
};

class Monitor {
 public:
  /// Creates, in `node`: publishers of /diagnostics and ~/metrics, services ~/metrics and ~/save. The executor
  /// has to execute the node, and to outlive this. Throws std::runtime_error if the folder for results cannot be used.
  Monitor(const rclcpp::Node::SharedPtr &node, ReDAGExecutor &executor, MonitorOptions options = MonitorOptions());
  /// finish(), with problems logged.
  ~Monitor();
  Monitor(const Monitor &) = delete;
  Monitor &operator=(const Monitor &) = delete;

  /// What ~/metrics answers ("redag.metrics/1", docs/results_format.md).
  [[nodiscard]] std::string metrics() const;

  /// Writes ReDAGExecutor::learned() as a workload file, without unnamed callbacks that never ran. The path as an
  /// absolute one, or why not.
  [[nodiscard]] redag::Result<std::string> save(const std::string &path) const;

  /// To be called when spinning has ended: writes the files of the options. Later calls do nothing.
  redag::Result<void> finish();

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace redag_rclcpp
