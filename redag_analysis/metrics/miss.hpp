// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Defines a deadline miss (docs/model.md, "What is measured") of a recorded job, for summaries, watches, tables, pages
// and experiments. runtime/stats.hpp does so for counters of a run that goes on. verdict.hpp puts it into words for
// whole runs. Pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

enum class Miss : std::uint8_t {
  None,
  Lost,      // skipped, or aborted although it had data
  Deadline,  // finished after its deadline, or in flight with its deadline passed
  EndToEnd,  // itself in time, but f - origin is above its DAG's end-to-end deadline
};

/// True if the job was skipped or aborted, whether it had data or not.
[[nodiscard]] bool has_no_response(const JobRecord &job);

/// True if the job never answers: it was skipped, or aborted although it had data. A job without data had nothing to
/// answer and is no miss.
[[nodiscard]] bool is_lost(const JobRecord &job);

/// True if f - origin is above `deadline`, the DAG's end-to-end deadline (0: none). A job in flight is late if it
/// exceeds `deadline` already at `end`.
[[nodiscard]] bool is_late_end_to_end(const JobRecord &job, Time end, Duration deadline);

/// Returns, by TaskId, whether the task is a sink: no task waits for it.
[[nodiscard]] std::vector<bool> sinks_of(const Workload &workload);

/// Returns, by TaskId, the end-to-end deadline that the task's jobs must keep: its DAG's for a sink, 0 (none) for
/// others. A DAG answers at its sinks; what another task does late shows there.
[[nodiscard]] std::vector<Duration> end_to_end_deadlines(const Workload &workload);

/// Judges a job. `end` is the end of the run, which counts for jobs in flight. `end_to_end` is its
/// end-to-end deadline (0: none).
[[nodiscard]] Miss miss_of(const JobRecord &job, Time end, Duration end_to_end = 0);

}  // namespace redag::metrics
