// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Folds the events of a run into slices: which job held which worker, and which device, when. Incremental, as JobFolder
// is. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <tuple>
#include <vector>

#include "redag/trace/trace.hpp"

namespace redag::report {

/// A job on a worker without interruption, or at a device from when it is served until it is woken.
struct Slice {
  enum class End : std::uint8_t { Finished, Aborted, Preempted, Open, Waits, Served };  // Open: the trace ends here

  Time begin = 0;
  Time end = 0;
  TaskId task;
  std::uint32_t job = 0;
  DeviceId device;           // invalid: on a worker
  std::uint32_t worker = 0;  // of a job on one
  End how = End::Open;

  friend bool operator==(const Slice &, const Slice &) = default;
};

/// Leaves out events of jobs that were never released, and of unknown devices.
class SliceFolder {
 public:
  /// `run` must outlive this object.
  explicit SliceFolder(const trace::RunInfo &run) : run_(run), tasks_(run.workload.task_count()) {}

  /// Continues from the last call.
  void add(std::span<const JobEvent> events);
  /// Ends the slices that are still open at the last event, or at the end of the run if that is later.
  void finish();

  /// Passes the slices that ended since the last call to visit(const Slice &), in order of their end.
  template <class Visit>
  void drain(Visit &&visit) {
    for (const Slice &slice : ended_) visit(slice);
    ended_.clear();
  }

 private:
  void begin(const JobEvent &event, DeviceId device = {});
  void end(const JobEvent &event, Time time, Slice::End how, DeviceId device = {});

  const trace::RunInfo &run_;
  std::size_t tasks_;
  std::map<std::tuple<TaskId, std::uint32_t, DeviceId>, Slice> open_;
  std::vector<Slice> ended_;
  Time last_ = 0;  // event
};

}  // namespace redag::report
