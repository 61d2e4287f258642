// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a deadline miss is (docs/model.md, "What is measured"): the one place, for summaries, watches, tables, pages and
// experiments. verdict.hpp says the same of whole runs in words. Pure functions.
#pragma once

#include <cstdint>

#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

enum class Miss : std::uint8_t {
  None,
  Lost,      // skipped, or aborted though it had data
  Deadline,  // finished after its deadline, or in flight with its deadline passed
  EndToEnd,  // in time itself, and f - origin above its DAG's end-to-end deadline
};

/// Skipped, or aborted though it had data: it never answers. One without data had nothing to answer, and is no miss.
[[nodiscard]] bool is_lost(const JobRecord &job);

/// Is f - origin above `deadline`, the end-to-end deadline of the DAG (0: none)? Of a job in flight: is it already, at
/// `end`?
[[nodiscard]] bool is_late_end_to_end(const JobRecord &job, Time end, Duration deadline);

/// `end`: when the run ended, which counts for jobs in flight. `end_to_end`: as above.
[[nodiscard]] Miss miss_of(const JobRecord &job, Time end, Duration end_to_end = 0);

}  // namespace redag::metrics
