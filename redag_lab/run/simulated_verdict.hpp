// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests whether a workload misses a deadline in one simulated run. The result is an observation beside a bound, not a
// proof: other offsets or shorter executions can be worse.
#pragma once

#include <atomic>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::lab {

/// Simulates `workload` on `platform` for `duration`, with its offsets, every job for its wcet, and no jitter. Returns
/// true if no job finished late, was skipped or aborted, and no DAG exceeded its end-to-end deadline. `stop` ends the
/// run with the answer false. The workload must be valid.
[[nodiscard]] bool misses_nothing(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                  Duration duration, const std::atomic<bool> *stop = nullptr);

}  // namespace redag::lab
