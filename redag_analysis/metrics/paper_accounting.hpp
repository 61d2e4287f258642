// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Deadline misses as the baseline program of the ReDAG-RT paper counts them, for comparison only: no result of this
// project is judged by it. Pure.
//
// It takes the k-th callback of a timer that ran for the one that was due at epoch + k T. But rclcpp drops releases
// that come too late, so that this nominal clock falls behind with every drop, for ever; and its epoch lies before
// start-up, so that all callbacks are late by what start-up took. A dropped release is no miss to it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "redag/model/workload.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

struct PaperCount {
  std::uint64_t jobs = 0;  // finished ones of timer tasks; others have no nominal release of their own
  std::uint64_t late = 0;
  std::optional<Duration> max_lateness;
};

/// `records` in order of release (fold_jobs()), from the start of the run; those of `dag` only, if given. A timer's
/// epoch is `startup` before its first release.
[[nodiscard]] PaperCount paper_count(const Workload &workload, std::span<const JobRecord> records, Duration startup,
                                     std::optional<DagId> dag = std::nullopt);

}  // namespace redag::metrics
