// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What jobs wait for without a worker. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag_analysis/core/task_set.hpp"

namespace redag::analysis {

/// The waits of one task.
struct WaitingTime {
  std::vector<DeviceUse> devices;  // by DeviceId
  Duration elsewhere = 0;          // waits without a device

  /// The longest time that a job is away from its worker and no job of a more urgent or equal task is served by a
  /// device or waits without one.
  [[nodiscard]] Duration total() const;
};

/// By TaskId: its own waits, and for each request to a device the less urgent service before it (DeviceUse::blocked),
/// which cannot be interrupted:
/// - `queue: priority`: one service, the longest of the less urgent tasks. It began before the request, and after it
///   the slot goes to the queue's first job, which is no less urgent.
/// - `queue: fifo`: one service of each less urgent task, whose request came before. Requires tasks whose jobs do not
///   overlap.
/// Empty if no task waits. Requires a valid workload.
[[nodiscard]] std::vector<WaitingTime> waiting_times(const Workload &workload);

/// For a task set whose tasks wait: why no bound covers their waits, or an empty text.
[[nodiscard]] std::string why_waits_are_not_covered(const TaskSet &task_set);

}  // namespace redag::analysis
