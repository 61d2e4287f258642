// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the monitor says, as values and as text: a snapshot of an executor, its JSON, its diagnostics. Pure functions
// and one value that remembers what was reported last.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "bounds.hpp"
#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "redag/runtime/setup.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

struct TaskFigures {
  CallbackStats stats;
  std::optional<TaskBound> bound;
  /// Is the deadline more than an assumption: stated by the workload, a timer's period, or learned?
  bool has_deadline = false;
};

struct Snapshot {
  redag::Time stamp = 0;  // ROS time
  redag::runtime::Mode mode;
  std::uint32_t workers = 0;
  redag::PolicyKind policy = redag::PolicyKind::RateMonotonic;
  bool learning = false;
  std::vector<std::string> warnings;
  bool has_bounds = false;
  std::string bounds_absent;                // what stands in the way of bounds; empty: nothing
  std::optional<redag::Overheads> machine;  // what the bounds charge of the machine
  std::vector<TaskFigures> tasks;
};

/// "redag.metrics/1" (docs/results_format.md), one line.
[[nodiscard]] std::string to_json(const Snapshot &snapshot);

/// One line for people: jobs, misses, and who missed most.
[[nodiscard]] std::string summarize(const Snapshot &snapshot);

/// Leaves out the tasks that never ran (services that nobody called, events of publishers), save those of DAGs that are
/// in `configured`, and DAGs without tasks: they would keep the workload from being analysed.
void drop_idle_tasks(redag::Workload &workload, const std::set<std::string> &configured);

/// Turns snapshots into diagnostics; what is new is new since the last one.
class Diagnoser {
 public:
  /// A status for the executor, one for each DAG, one for each node with callbacks that the workload does not name.
  [[nodiscard]] std::vector<diagnostic_msgs::msg::DiagnosticStatus> diagnose(const Snapshot &snapshot);

 private:
  void add(diagnostic_msgs::msg::DiagnosticStatus &status, const TaskFigures &task,
           const std::optional<redag::Overheads> &machine);

  std::map<std::string, std::uint64_t> misses_;  // by callback
};

}  // namespace redag_rclcpp
