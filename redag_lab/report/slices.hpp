// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Folds the events of a run into slices: which job held which worker, when. Incremental, as JobFolder is. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/trace/trace.hpp"

namespace redag::report {

/// A job on a worker, without interruption.
struct Slice {
  enum class End : std::uint8_t { Finished, Aborted, Preempted, Open, Waits };  // Open: the trace ends here

  Time begin = 0;
  Time end = 0;
  TaskId task;
  std::uint32_t job = 0;
  std::uint32_t worker = 0;
  End how = End::Open;

  friend bool operator==(const Slice &, const Slice &) = default;
};

/// Leaves out events of jobs that were never released.
class SliceFolder {
 public:
  /// `run` must outlive this object.
  explicit SliceFolder(const trace::RunInfo &run) : run_(run), open_(run.workload.task_count()) {}

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
  void begin(const JobEvent &event);
  void end(const JobEvent &event, Time time, Slice::End how);

  const trace::RunInfo &run_;
  std::vector<std::vector<Slice>> open_;  // by TaskId
  std::vector<Slice> ended_;
  Time last_ = 0;  // event
};

}  // namespace redag::report
