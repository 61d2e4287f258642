// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of DAGs and tasks that wait without a worker, for devices or otherwise, on any number of workers. Both
// need R <= T. Proofs: docs/analysis.md, "Waits on any number of workers". Workers and devices are alike: resources of
// several servers, for which a critical path waits while all are busy. No proof covers groups, cooperative preemption
// points, shared levels, edges between rates or HI mode beside waits, so such workloads get no bound.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Static priorities that keep DAGs together. Less urgent service that has begun blocks; with run to completion less
/// urgent jobs do, too. Carried work as in M. Bertogna, M. Cirinei, RTSS 2007: a job works between its release and its
/// response, however it waits.
[[nodiscard]] Method suspension_aware();

/// The same with all other DAGs as interference, for any work-conserving order of workers and devices. The responses
/// rely on each other: all are bounded or none is.
[[nodiscard]] Method suspension_aware_any();

}  // namespace redag::analysis
