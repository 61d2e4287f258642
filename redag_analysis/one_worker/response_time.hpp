// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response-time analyses for one worker and static priorities, of independent tasks and of DAGs, on the fixed points of
// one_worker.hpp. A DAG on one core is a task with C = its volume, for any order inside. O(n) a step, pseudo-polynomial
// in all. Proofs: docs/analysis.md, "One worker".
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Full preemption. Covers any deadlines, jitter, blocking by shared groups (inheritance) and shared levels.
/// M. Joseph, P. Pandya, The Computer Journal 29(5), 1986; K. Tindell, A. Burns, A. Wellings, RTS 6(2), 1994.
[[nodiscard]] Method rta_preemptive();

/// Jobs run to completion; examines all jobs of the busy period. R. Davis, A. Burns, R. Bril, J. Lukkien, RTS
/// 35(3), 2007.
[[nodiscard]] Method rta_nonpreemptive();

/// Preemption points every `region`. Less urgent callbacks block once, and the last stretch is the shortest one that
/// can end the DAG. R. Bril, J. Lukkien, W. Verhaegh, RTS 42, 2009.
[[nodiscard]] Method rta_deferred();

}  // namespace redag::analysis
