// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Extends bounds for single units to units that wait for data of other rates. Waiting counts as release jitter: a
// waiting job holds nothing, and never waits again once it is ready. Each method that takes jitter is applied
// repeatedly, with the waits that its own responses imply, until both agree. Proofs: docs/analysis.md, "Edges between
// rates". Pure functions.
#pragma once

#include <optional>
#include <string>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Why a method cannot analyse the task set on its own: rate edges, or threads that suffice only if all tasks are
/// bounded. Empty if it can.
[[nodiscard]] std::optional<std::string> why_not_directly(const TaskSet &task_set);

/// True if across_rates() does more than call `apply`: rate edges, few threads, or a max_active over several units.
[[nodiscard]] bool is_across_rates(const TaskSet &task_set);

/// Applies `apply` to the task set without its rate edges, with the waits as jitter. `apply` must bound responses by
/// units, take release jitter, and give no bound to a unit whose jitter is at least its limit. If
/// most_jobs_in_progress() is within them, a max_active of a DAG in several parts and a small number of threads are
/// removed, too. Then either all tasks concerned are bounded or none is. Assumes that timers keep their periods: a
/// source that pauses makes others wait. A data task behind a rate edge is bounded from its own release, a timer task
/// from its nominal one, and a DAG from the earliest origin of its data. At most a thousand applications.
[[nodiscard]] Outcome across_rates(const TaskSet &task_set, Outcome (*apply)(const TaskSet &task_set));

}  // namespace redag::analysis
