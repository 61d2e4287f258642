// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The schedule as a picture: which job held which worker when, and, of a run too long to be drawn, the stretches of
// time worth a look: its beginning, and where each DAG came closest to its deadline or farthest beyond. Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::report {

/// A job on a worker, without a break.
struct Slice {
  enum class End : std::uint8_t { Finished, Aborted, Preempted, Open };  // Open: the trace ends here

  Time begin = 0;
  Time end = 0;
  TaskId task;
  std::uint32_t job = 0;
  std::uint32_t worker = 0;
  End how = End::Open;

  friend bool operator==(const Slice &, const Slice &) = default;
};

/// In order of their begin. Events of jobs that were never released are left out.
[[nodiscard]] std::vector<Slice> slices_of(const trace::Trace &trace);

/// A stretch of the run with all that it takes to draw it.
struct Window {
  Time begin = 0;
  Time end = 0;
  std::vector<Slice> slices;             // that reach into it, in order of their begin
  std::vector<metrics::JobRecord> jobs;  // alive in it, in order of release
};

/// Something to look at: a stretch of time in a window, and the job that it is about (none: `task` is invalid).
struct View {
  std::size_t window = 0;
  Time begin = 0;
  Time end = 0;
  TaskId task;
  std::uint32_t job = 0;
  Duration lateness = 0;  // of that job
};

struct Schedule {
  std::vector<Window> windows;
  std::vector<View> views;  // the first is the beginning of the run
  std::uint64_t slices_in_all = 0;
  std::uint64_t slices_shown = 0;  // less than all: the windows do not cover the run
};

/// `most` bounds the slices of all windows together, and the jobs to twice as many. `jobs` in order of release. Of the
/// `most_views` DAGs with the latest jobs, relative to their deadlines, each gets a view.
[[nodiscard]] Schedule schedule_of(const trace::Trace &trace, std::span<const metrics::JobRecord> jobs,
                                   std::size_t most, std::size_t most_views);

}  // namespace redag::report
