// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One run of a workload as ROS 2 nodes on one executor, from the file to result files; what `redag run` is without
// ROS. Blocks until the run is over; one at a time. rclcpp must be initialised.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check_report.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag_rclcpp {

/// Names for --executor, ours first: "redag", "redag-os", "mte", ...
[[nodiscard]] const std::vector<std::string> &executor_names();

/// Error: an unknown name, or one that this ROS distribution does not have.
[[nodiscard]] redag::Result<void> check_executor(const std::string &name);

struct WorkloadRunOptions {
  std::string executor = "redag";
  redag::Duration duration = 10 * redag::kSecond;
  redag::Duration warm_up = 0;
  std::uint64_t seed = 1;
  bool intra_process = true;
  std::uint32_t threads = 0;  // 0: the workload's workers; executors with one thread have one
  const std::atomic<bool> *stop = nullptr;
};

/// What our executor's scheduler decided, by its own account.
struct SchedulerTrace {
  redag::trace::Trace trace;
  redag::metrics::CheckReport check;
};

struct WorkloadRun {
  redag::trace::Trace trace;  // as the nodes saw it
  redag::metrics::Summary summary;
  redag::metrics::CheckReport check;  // of `trace`
  std::optional<SchedulerTrace> scheduler;
  std::vector<std::string> warnings;
  bool stopped = false;
};

/// `workload` must be valid. Errors: what ROS or the machine refuse.
[[nodiscard]] redag::Result<WorkloadRun> run_as_nodes(const redag::Workload &workload,
                                                      const WorkloadRunOptions &options);

/// jobs.csv, summary.json, trace.json, events.jsonl, and for our executor scheduler_events.jsonl; and check.json with
/// the verdicts. Everything that went wrong.
[[nodiscard]] redag::Diagnostics write_results(const WorkloadRun &run, const std::string &folder);

/// The run for people: a table of tasks, one of DAGs, verdicts.
[[nodiscard]] std::string describe(const WorkloadRun &run);

}  // namespace redag_rclcpp
