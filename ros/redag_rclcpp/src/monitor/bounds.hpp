// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares response times with proven bounds. Finds the bound of each task as the executor really runs it, and counts
// the responses that exceed it. A value; not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/loader/calibration.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag_analysis/metrics/bound_watch.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

struct TaskBound {
  redag::Duration response = 0;
  std::string method;          // analysis that gave the bound; see `redag analyze --methods`
  std::uint64_t exceeded = 0;  // responses above the bound
  redag::Duration worst = 0;   // longest response above the bound
};

class Bounds {
 public:
  /// `workload`: the workload as its file states it. `calibration`: overheads of this machine to charge, if any.
  explicit Bounds(redag::Workload workload, std::optional<redag::Calibration> calibration = std::nullopt)
      : workload_(std::move(workload)), calibration_(std::move(calibration)) {}

  /// Repeats the analysis if the callbacks behind the tasks have changed since the last call. Calls `learned` only
  /// then. A task that is one callback gets the exclusive group of this callback in ROS. Blocks for the time of the
  /// analysis. Returns true if it was repeated.
  bool update(const std::vector<CallbackStats> &stats, const redag::sched::Config &config,
              const std::function<redag::Workload()> &learned);

  /// Counts responses above their bounds. `name_of` maps an event's task id to "dag.task"; it is called once for each
  /// id. `first` is called for the first response of each task that exceeds the bound.
  void count(std::span<const redag::JobEvent> events, const std::function<std::string(redag::TaskId)> &name_of,
             const std::function<void(const std::string &name, const TaskBound &bound)> &first);

  /// Bounds by "dag.task".
  [[nodiscard]] const std::map<std::string, TaskBound> &tasks() const { return bounds_; }
  /// The reason why some tasks have no bound; empty: all have one.
  [[nodiscard]] const std::string &absent() const { return absent_; }
  /// Overheads of this machine that the bounds include; empty: none.
  [[nodiscard]] const std::optional<redag::Overheads> &machine() const { return machine_; }

 private:
  /// Gives `workload_` as the executor runs it. False: it cannot be compared, and `absent_` says why.
  [[nodiscard]] bool as_executed(const std::vector<CallbackStats> &stats, const redag::Workload &learned,
                                 std::uint32_t workers, redag::Workload &result);
  void analyse(const redag::Workload &workload, const redag::sched::Config &config);

  redag::Workload workload_;
  std::optional<redag::Calibration> calibration_;
  std::optional<redag::Overheads> machine_;  // part of calibration_ that the bounds include
  std::vector<std::string> analysed_;        // tasks and callbacks of the last analysis
  std::map<std::string, TaskBound> bounds_;
  std::string absent_ = "no callback has been seen yet";

  redag::metrics::BoundWatch watch_;  // counts against bounds_; starts anew with them
};

}  // namespace redag_rclcpp
