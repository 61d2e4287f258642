// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A run at a glance, however long: for each of a fixed number of equal stretches of time, how busy each DAG kept the
// workers and how many deadlines it missed there. Pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_lab/report/schedule.hpp"

namespace redag::report {

struct Timeline {
  Time begin = 0;
  Duration bin = 1;  // length of a stretch; the last one can reach beyond the end of the run
  std::size_t bins = 0;
  std::vector<std::vector<Duration>> busy;           // by DagId, then by stretch: time on workers, of all workers
  std::vector<std::vector<std::uint64_t>> released;  // jobs by the stretch of their release
  std::vector<std::vector<std::uint64_t>> missed;    // of these: late, overdue, skipped or aborted (not without data)
};

/// At most `most_bins` stretches of whole microseconds (or shorter, for runs of that length). Requires most_bins > 0.
[[nodiscard]] Timeline timeline_of(const trace::Trace &trace, std::span<const Slice> slices,
                                   std::span<const metrics::JobRecord> jobs, std::size_t most_bins);

}  // namespace redag::report
