// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a workload as ROS 2 nodes on one executor, and writes result files. It corresponds to `redag run` without ROS.
// Blocks until the run is over; only one run at a time. rclcpp must be initialised.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/check_report.hpp"
#include "redag_analysis/metrics/summary.hpp"

namespace redag_rclcpp::lab {

/// Names for --executor, those of ReDAGExecutor first: "redag", "redag-os", "mte", ...
[[nodiscard]] const std::vector<std::string> &executor_names();

/// Error: the name is unknown, or this ROS distribution lacks the executor.
[[nodiscard]] redag::Result<void> check_executor(const std::string &name);

struct WorkloadRunOptions {
  std::string executor = "redag";
  redag::Duration duration = 10 * redag::kSecond;
  redag::Duration warm_up = 0;
  std::uint64_t seed = 1;
  bool intra_process = true;
  std::uint32_t threads = 0;  // 0: the workload's workers; executors with one thread ignore it
  const std::atomic<bool> *stop = nullptr;
};

/// The decisions of ReDAGExecutor's scheduler, from its own trace.
struct SchedulerTrace {
  redag::trace::Trace trace;
  redag::metrics::CheckReport check;
};

struct WorkloadRun {
  redag::trace::Trace trace;  // as the nodes recorded it
  redag::metrics::Summary summary;
  redag::metrics::CheckReport check;  // check of `trace`
  std::optional<SchedulerTrace> scheduler;
  std::vector<std::string> warnings;
  bool stopped = false;
};

/// `workload` must be valid. Errors: requests that ROS or the machine refuse.
[[nodiscard]] redag::Result<WorkloadRun> run_as_nodes(const redag::Workload &workload,
                                                      const WorkloadRunOptions &options);

/// Writes jobs.csv, summary.json, events.redag, of short runs trace.pftrace, check.json with the verdicts, and for
/// ReDAGExecutor scheduler_events.redag. Returns all problems.
[[nodiscard]] redag::Diagnostics write_results(const WorkloadRun &run, const std::string &folder);

/// The run as text: a table of tasks, a table of DAGs, and the verdicts.
[[nodiscard]] std::string describe(const WorkloadRun &run);

}  // namespace redag_rclcpp::lab
