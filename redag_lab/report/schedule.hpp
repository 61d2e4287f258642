// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The schedule as a picture: which job held which worker, and which device, when. Of a run too long to draw, it keeps
// the interesting stretches: the job of each DAG closest to its deadline or latest after it, and the beginning. Reads
// the run up to three times, in memory that does not grow with it.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/recording.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/why_cause.hpp"
#include "redag_lab/report/services.hpp"
#include "redag_lab/report/slices.hpp"

namespace redag::report {

/// A stretch of the run with all the data for drawing it.
struct Window {
  Time begin = 0;
  Time end = 0;
  std::vector<Slice> slices;             // overlapping the window, in order of their begin
  std::vector<Service> services;         // the same of devices; each follows a slice
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
  std::vector<View> views;  // of jobs, the worst first; the last is the beginning of the run
  std::uint64_t slices_in_all = 0;
  std::uint64_t slices_shown = 0;  // if less than all, the windows do not cover the run
};

/// Makes the schedule. `most` bounds the slices of all windows together, and the jobs to twice as many. The
/// `most_views` DAGs with the latest jobs, relative to their deadlines, get a view each. `first` gets the first view,
/// in place of the latest job of its DAG. Error: a damaged file.
[[nodiscard]] Result<Schedule> schedule_of(const trace::Recording &run, std::size_t most, std::size_t most_views,
                                           const std::optional<metrics::JobId> &first = std::nullopt);

}  // namespace redag::report
