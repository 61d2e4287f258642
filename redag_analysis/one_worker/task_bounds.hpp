// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds each task on one worker by what can delay it, not by its whole DAG: only its own predecessors have to end, and
// the levels of its predecessors may differ from those of its successors. Proofs: docs/analysis.md, "One worker". Pure
// functions.
#pragma once

#include <cstdint>
#include <span>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis::one_worker {

/// bound_tasks() bounds every task from the nominal release of its unit, and every DAG by its last task. `deferred`:
/// jobs run to completion or to a preemption point. Requires a task set that why_not() accepts. O(n) per step; a task
/// whose predecessors have s different priorities takes s fixed points for each job of its busy period. `units`: bounds
/// the tasks of these alone; none: all.
[[nodiscard]] Bound bound_tasks(const TaskSet &task_set, bool deferred, std::span<const std::uint32_t> units = {});

}  // namespace redag::analysis::one_worker
