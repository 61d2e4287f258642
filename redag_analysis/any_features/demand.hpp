// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How many jobs of each task can execute or wait in a window, whatever the responses of others are, and the windows
// that these jobs can fill. Pure functions; the proofs are in docs/analysis.md, "Any features".
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "redag_analysis/any_features/rivals.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis::any_features {

/// At most (window + jitter) / period + more events in any closed window.
struct JobCount {
  Duration period = 1;
  Duration jitter = 0;
  Duration more = 0;

  [[nodiscard]] Duration in(Duration window) const { return add(add(window, jitter) / period, more); }
  /// The earliest window that can contain this many.
  [[nodiscard]] Duration earliest(Duration number) const {
    return std::max<Duration>(0, saturate(Int128{number - more} * period - jitter));
  }
};

/// Returns the count with the larger period, or the smaller one of the two.
[[nodiscard]] JobCount rarer(const JobCount &a, const JobCount &b);

/// A timer that has a job only if its predecessors have data.
[[nodiscard]] inline bool waits_for_data(const CompiledTask &task) { return !task.data && !task.predecessors.empty(); }

/// The most jobs of the task that are unfinished at once: those that have started, that are ready, and one that waits
/// for data.
[[nodiscard]] Duration unfinished(const CompiledTask &task);

/// What is known of a task set, and of the responses found so far.
struct Demand {
  explicit Demand(const TaskSet &all);

  /// The most jobs of the task that execute or wait in the window.
  [[nodiscard]] Duration active(std::uint32_t t, Duration window) const;
  [[nodiscard]] const CompiledTask &task(std::uint32_t t) const { return task_set.tasks[t]; }

  const TaskSet &task_set;
  bool few_threads = false;                    // started jobs can hold all threads
  bool has_waits = false;                      // jobs of some task wait without a worker
  Duration stop = 0;                           // longer windows count as none
  std::vector<JobCount> released;              // by TaskId
  std::vector<std::optional<Duration>> since;  // by TaskId: from the release as seen, or from readiness, to the end
  std::vector<std::optional<Duration>> until;  // by TaskId: of timers that wait for data, from release to readiness
};

/// The time that a job of the task executes, and the time that it waits, without queues.
[[nodiscard]] inline Duration executes(const CompiledTask &task) { return task.wcet - task.waits; }
[[nodiscard]] Duration away(const CompiledTask &task);
[[nodiscard]] inline bool uses(const CompiledTask &task, std::size_t device) {
  return device < task.devices.size() && task.devices[device].requests > 0;
}

/// The longest time from the release of a job as seen, or from its readiness, to its end; nothing if the demand is too
/// large. `all`: as if every task could go first.
[[nodiscard]] std::optional<Duration> window_of(const Demand &demand, std::uint32_t t, bool all);
/// The same on one worker, from the busy period of the task's level.
[[nodiscard]] std::optional<Duration> busy_period_of(const Demand &demand, std::uint32_t t, bool all);

/// The most that less urgent holders of the group do with the urgency of others: all that they can, or one job for each
/// job that waits for the group.
[[nodiscard]] Duration lifted_work(const TaskSet &task_set, const std::vector<std::uint32_t> &group,
                                   const Rivals &rivals, const std::function<Duration(std::uint32_t)> &jobs,
                                   const std::function<Duration(std::uint32_t)> &cost);

}  // namespace redag::analysis::any_features
