// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The schedule as a picture: which job held which worker, and which device, when. Of a run too long to draw, it keeps
// the stretches around given jobs, and the beginning. Reads the run once, in memory that does not grow with it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/recording.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_lab/report/slices.hpp"

namespace redag::report {

/// A stretch of the run with all the data for drawing it.
struct Window {
  Time begin = 0;
  Time end = 0;
  std::vector<Slice> slices;             // overlapping the window, in order of their begin
  std::vector<metrics::JobRecord> jobs;  // alive in the window, in order of release
};

/// A stretch of time in a window and the job that it presents.
struct View {
  std::size_t window = 0;
  Time begin = 0;
  Time end = 0;
  std::optional<metrics::JobRecord> job;  // empty: the view is of the beginning of the run
};

struct Schedule {
  std::vector<Window> windows;
  std::vector<View> views;  // of the jobs, as they were given; the last is the beginning of the run
  bool is_whole = false;    // the run is in one window
};

/// Makes the schedule with a view of each of the jobs. `most` bounds the slices of all windows together, and the jobs
/// to twice as many. Error: a damaged file.
[[nodiscard]] Result<Schedule> schedule_of(const trace::Recording &run, std::span<const metrics::JobRecord> jobs,
                                           std::size_t most);

}  // namespace redag::report
