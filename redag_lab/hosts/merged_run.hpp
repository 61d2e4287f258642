// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The runs of several hosts as one: each host is a cluster (or several) of one platform, and its times are shifted onto
// one clock. A shift, and no other change of a time, leaves what happened on a host exactly as its own record has it.
// Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/trace.hpp"
#include "redag_lab/hosts/clock_offset.hpp"

namespace redag::hosts {

/// A recorded run, and what is known of its clock.
struct HostRun {
  std::string name;
  std::string path;  // of the events, for messages
  trace::EventsReader reader;
  ClockStatement clock;
  std::string file = {};  // where the host stands in a file of hosts; empty: on the command line
  int line = 0;
  int column = 0;
};

/// A host in the merged run.
struct Host {
  std::string name;
  std::string path;     // of its own events
  trace::RunInfo info;  // of its own run, in its own time
  std::string clock_by;
  ClockOffset clock;
  Duration shift = 0;  // added to its times
  std::uint32_t first_worker = 0;
  std::uint32_t first_task = 0;
  std::uint32_t first_dag = 0;
  std::uint32_t first_device = 0;

  /// By how much a shifted time of the host can be wrong: what to add to it is in this interval.
  [[nodiscard]] Interval correction(Time merged) const;
  /// Its event in the merged run. Requires an event of its own run.
  [[nodiscard]] JobEvent merged(JobEvent event) const;
};

/// Bounds of the true time from one instant to another, both in merged time; `from` and `to` can be the same host.
[[nodiscard]] Interval time_between(const Host &from, Time begin, const Host &to, Time end);

struct MergedRun {
  trace::RunInfo info;  // from the first start to the first end
  std::vector<Host> hosts;
  std::vector<std::uint32_t> host_of_task;  // by TaskId of the merged run
};

/// Describes the merged run. Errors, of all hosts: what ClockOffset::of() refuses; runs of different kinds; clocks of
/// which only some state the system's time; no common time.
[[nodiscard]] Result<MergedRun> merge(const std::vector<HostRun> &runs);

/// Passes the events of all hosts up to the end of the merged run to `visit`, in order of time, some at a time. Holds
/// one block of each host. `is_stopped` is asked now and then, and makes it an error. Errors: those of the readers.
[[nodiscard]] Result<void> visit_merged(const MergedRun &merged, std::vector<HostRun> &runs,
                                        const std::function<bool()> &is_stopped,
                                        const std::function<void(std::span<const JobEvent>)> &visit);

}  // namespace redag::hosts
