// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The monitor's reports as values and as text: a snapshot of an executor, its JSON text, its diagnostics. These are
// pure functions, and one class that remembers the last report.
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
#include "redag/threads/setup.hpp"
#include "redag_rclcpp/executor.hpp"

namespace redag_rclcpp {

struct TaskFigures {
  CallbackStats stats;
  std::optional<TaskBound> bound;
  /// True if the deadline is stated by the workload, a timer's period, or learned. Otherwise it is an assumption.
  bool has_deadline = false;
  bool is_shown = true;  // with all its figures
};

struct Snapshot {
  redag::Time stamp = 0;  // ROS time
  redag::runtime::Mode mode;
  std::uint32_t workers = 0;
  redag::PolicyKind policy = redag::PolicyKind::RateMonotonic;
  bool learning = false;
  std::vector<std::string> warnings;
  std::vector<std::string> errors;  // those of `warnings` that break a promise about deadlines
  std::vector<Deadlock> deadlocks;  // those that last and those that have ended
  bool has_bounds = false;
  std::string bounds_absent;                // reason why some tasks have no bound; empty: all have one
  std::optional<redag::Overheads> machine;  // overheads of this machine that the bounds include
  std::vector<TaskFigures> tasks;
};

/// The snapshot as JSON, "redag.metrics/1" (docs/results_format.md), on one line.
[[nodiscard]] std::string to_json(const Snapshot &snapshot);

/// Shows no more than `most` callbacks: those with the most misses, then the most urgent ones.
void show_most(Snapshot &snapshot, std::size_t most);

/// Three lines for the end of a run: whether all was as promised; which rates are known; jobs, misses, and the callback
/// with the most of them, with the likely cause and what helps.
[[nodiscard]] std::vector<std::string> closing_lines(const Snapshot &snapshot);

/// Removes tasks that never ran (unused services, events of publishers), except those of the DAGs in `configured`. Then
/// removes DAGs without tasks. Such tasks and DAGs would prevent an analysis of the workload.
void drop_idle_tasks(redag::Workload &workload, const std::set<std::string> &configured);

/// Turns snapshots into diagnostics. Warns of deadlines that were missed since the previous snapshot.
class Diagnoser {
 public:
  /// Returns a status for the executor, one for each DAG, and one for each node with callbacks that the workload does
  /// not name.
  [[nodiscard]] std::vector<diagnostic_msgs::msg::DiagnosticStatus> diagnose(const Snapshot &snapshot);

 private:
  void add(diagnostic_msgs::msg::DiagnosticStatus &status, const TaskFigures &task,
           const std::optional<redag::Overheads> &machine);

  std::map<std::string, std::uint64_t> misses_;  // by callback
};

}  // namespace redag_rclcpp
