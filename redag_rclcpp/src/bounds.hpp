// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times against proven bounds: which bound each task of a workload has on the executor as it runs, and which
// responses exceeded it. A value; not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/overheads.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"
#include "redag_analysis/metrics/bound_watch.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

struct TaskBound {
  redag::Duration response = 0;
  std::string method;          // that gave it, see `redag analyze --methods`
  std::uint64_t exceeded = 0;  // responses above it
  redag::Duration worst = 0;   // of these
};

class Bounds {
 public:
  /// `workload`: as its file has it. `calibration`: what is charged of this machine, if anything.
  explicit Bounds(redag::Workload workload, std::optional<redag::Calibration> calibration = std::nullopt)
      : workload_(std::move(workload)), calibration_(std::move(calibration)) {}

  /// Analyses anew if the callbacks behind the tasks are not those of the last call. `learned` is asked only then. A
  /// task that is one callback has the exclusive group that ROS gave this callback. Takes as long as the analysis. True
  /// if it was done.
  bool update(const std::vector<CallbackStats> &stats, const redag::sched::Config &config,
              const std::function<redag::Workload()> &learned);

  /// Counts responses above their bounds. `name_of`: "dag.task" of an event's task id, asked once an id.
  /// `first`: told of the first response above the bound of each task.
  void count(std::span<const redag::JobEvent> events, const std::function<std::string(redag::TaskId)> &name_of,
             const std::function<void(const std::string &name, const TaskBound &bound)> &first);

  /// By "dag.task".
  [[nodiscard]] const std::map<std::string, TaskBound> &tasks() const { return bounds_; }
  /// What stands in the way of bounds for all tasks; empty: nothing.
  [[nodiscard]] const std::string &absent() const { return absent_; }
  /// What the bounds charge of this machine; none: nothing.
  [[nodiscard]] const std::optional<redag::Overheads> &machine() const { return machine_; }

 private:
  /// `workload_` as the executor runs it. False, and `absent_` says why: it cannot be compared.
  [[nodiscard]] bool as_executed(const std::vector<CallbackStats> &stats, const redag::Workload &learned,
                                 redag::Workload &result);
  void analyse(const redag::Workload &workload, const redag::sched::Config &config);

  redag::Workload workload_;
  std::optional<redag::Calibration> calibration_;
  std::optional<redag::Overheads> machine_;  // of it, what the bounds charge
  std::vector<std::string> analysed_;        // what the last analysis was for
  std::map<std::string, TaskBound> bounds_;
  std::string absent_ = "no callback was seen yet";

  redag::metrics::BoundWatch watch_;  // against bounds_; begins anew with them
};

}  // namespace redag_rclcpp
