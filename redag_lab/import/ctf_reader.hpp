// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads recordings in the Common Trace Format, as LTTng writes them, by libbabeltrace2. Passes the events of
// ros2_tracing on in the order of time, and keeps none. One at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "redag/base/result.hpp"
#include "redag_lab/import/event.hpp"

namespace redag::lab {

struct ReadTrace {
  std::uint64_t events = 0;  // of all kinds
  std::uint64_t lost = 0;    // events that the tracer could not keep
  bool lost_more = false;    // and others, in unknown number
  bool stopped = false;      // by `progress`
  std::uint64_t cpus = 1;    // processors with events, and those before them
};

/// Called at times with the share of the recording that is read, from 0 to 1. Returns false to stop.
using ReadProgress = std::function<bool(double done)>;

/// Reads the recording in a folder, or all that lie below it: as `ros2 trace` and `lttng` leave it. Errors: none is
/// there, one is damaged, its events lack time, process or thread, or this program was built without libbabeltrace2.
[[nodiscard]] Result<ReadTrace> read_ros_trace(const std::string &folder,
                                               const std::function<void(const RosEvent &)> &sink,
                                               const ReadProgress &progress = {});

}  // namespace redag::lab
