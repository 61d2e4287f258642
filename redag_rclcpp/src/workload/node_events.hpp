// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The life of every job of a workload that runs as ROS 2 nodes, out of what the nodes themselves saw: when which body
// began and ended. What no callback sees follows from the model: releases stand on the timers' grid or at the end of
// the last predecessor, and a job that never began was skipped. Pure function.
#pragma once

#include <span>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag_rclcpp {

struct NodeEventsOptions {
  redag::Time end = 0;              // nothing is released at or after it; later events are left out
  redag::Duration phase_error = 0;  // the timers' grid is off its points by at most this: a call so early is on time
  bool timers_queue = false;        // the executor keeps every expiry: those that have not run at the end are in flight
};

/// `bodies`: Started and Finished or Aborted of each body that began, and Preempted and Resumed of one that was kept
/// from its processor, in any order. `job` of a timer task is the point of its grid, and `value` of a data task's
/// Started the end of its last predecessor, as the messages told. Times count from the origin of the grid. The result
/// is a stream as other drivers make it: job numbers, Released to Finished, in order of time. Dispatched has the time
/// of Started: when the executor decided, the nodes do not see. A release that the executor overlooked while it began
/// the job before (its timer was called in time, its message taken) is noted right after that beginning, several one
/// after the other.
[[nodiscard]] std::vector<redag::JobEvent> node_events(const redag::Workload &workload,
                                                       std::span<const redag::JobEvent> bodies,
                                                       const NodeEventsOptions &options);

}  // namespace redag_rclcpp
