// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response-time analyses for one worker and static priorities, independent tasks and DAGs: five methods on the fixed
// points of one_worker.hpp. O(n) a step, pseudo-polynomial in all.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Full preemption, no edges. Covers any deadlines, jitter, blocking by shared groups (inheritance) and shared levels.
/// M. Joseph, P. Pandya, The Computer Journal 29(5), 1986; K. Tindell, A. Burns, A. Wellings, RTS 6(2), 1994.
[[nodiscard]] Method rta_preemptive();

/// Jobs run to completion, no edges; examines all jobs of the busy period. R. Davis, A. Burns, R. Bril, J. Lukkien, RTS
/// 35(3), 2007.
[[nodiscard]] Method rta_nonpreemptive();

/// Preemption points every `region`, no edges. R. Bril, J. Lukkien, W. Verhaegh, RTS 42, 2009.
[[nodiscard]] Method rta_deferred();

/// Full preemption, DAGs: a DAG on one core is a task with C = its volume, for any order inside.
[[nodiscard]] Method dag_one_worker_preemptive();

/// Callbacks run to completion or to a preemption point; DAGs. As rta_deferred with C = volume. Less urgent callbacks
/// block once, and the last stretch is the shortest one that can end the DAG. Proof: docs/analysis.md, "DAGs on one
/// worker".
[[nodiscard]] Method dag_one_worker_deferred();

}  // namespace redag::analysis
