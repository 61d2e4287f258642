// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts deadline misses as the baseline program of the ReDAG-RT paper does, for comparison only: no result of this
// project is judged by it. Pure.
//
// The program takes the k-th callback that ran for the one due at epoch + k T. rclcpp drops releases that come too
// late, and each drop sets this nominal clock back for good. The epoch lies before start-up, which makes all callbacks
// late by the duration of start-up. A dropped release does not count as a miss.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "redag/model/workload.hpp"
#include "redag_analysis/metrics/jobs.hpp"

namespace redag::metrics {

struct PaperCount {
  std::uint64_t jobs = 0;  // finished jobs of timer tasks; other tasks have no nominal release of their own
  std::uint64_t late = 0;
  std::optional<Duration> max_lateness;
};

/// `records` are in order of release (fold_jobs()), from the start of the run. With `dag`, only its jobs count. A
/// timer's epoch is `startup` before its first release.
[[nodiscard]] PaperCount paper_count(const Workload &workload, std::span<const JobRecord> records, Duration startup,
                                     std::optional<DagId> dag = std::nullopt);

}  // namespace redag::metrics
