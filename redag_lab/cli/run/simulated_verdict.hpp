// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Does a workload miss a deadline in one simulated run? An observation to set beside a bound, never a proof: other
// offsets or shorter executions can be worse.
#pragma once

#include <atomic>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/system.hpp"

namespace redag::cli {

/// Runs `workload` on `platform` for `duration`, offsets as they are, every job for its wcet and without jitter. True
/// if no job finished late, was skipped or aborted, and no DAG ended after its end-to-end deadline. `stop` ends the
/// run: the answer is false then. The workload must be valid.
[[nodiscard]] bool misses_nothing(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                  Duration duration, const std::atomic<bool> *stop = nullptr);

}  // namespace redag::cli
