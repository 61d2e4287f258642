// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// node_events() derives the life of every job of a workload that runs as ROS 2 nodes. The nodes record when bodies
// begin and end. The rest follows from the model. Releases are points of the timers' grid, or ends of the last
// predecessor. A job that never began was skipped. Pure function.
#pragma once

#include <span>
#include <vector>

#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag_rclcpp::lab {

struct NodeEventsOptions {
  redag::Time end = 0;              // no job is released at or after it; later events are left out
  redag::Duration phase_error = 0;  // largest error of the timers' grid; a call this much early is on time
  bool timers_queue = false;  // the executor keeps every expiry: expiries that have not run at the end are in flight
};

/// `bodies` holds, in any order, Started and Finished or Aborted of each body, and Preempted and Resumed of bodies that
/// lost their processor. `job` of a timer task is the point of its grid. `value` of a data task's Started is the end of
/// its last predecessor, taken from the messages. Times count from the origin of the grid.
///
/// The result is a stream like that of other drivers: job numbers from 0, events from Released to Finished, ordered by
/// time. Dispatched has the time of Started, because the nodes do not see when the executor decided. The executor may
/// overlook releases while it begins the previous job (its timer was called in time, its message taken). Such releases
/// are placed one after the other, right after that start.
[[nodiscard]] std::vector<redag::JobEvent> node_events(const redag::Workload &workload,
                                                       std::span<const redag::JobEvent> bodies,
                                                       const NodeEventsOptions &options);

}  // namespace redag_rclcpp::lab
