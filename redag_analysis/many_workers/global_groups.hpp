// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of tasks and DAGs that share exclusive groups, on one worker or several, with full preemption and
// priority inheritance or run to completion. Within a group jobs run one after the other. A chain's waits for its
// groups thus count in full, not divided by m. Assumes sporadic releases with jitter, groups held from a job's start to
// its end by a holder that inherits (L. Sha, R. Rajkumar, J. Lehoczky, IEEE TC 39(9), 1990), and for run to completion
// no max_active that binds. After A. Melani et al., ECRTS 2015 (paths through DAGs), and J. Lehoczky, RTSS 1990
// (several instances in one window). Proof: docs/analysis.md, "Exclusive groups". Pure functions.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Bounds each task over the chains of jobs that can delay it: R = max over q instances of J + x - (q - 1) T, where x =
/// chain + waits for groups + floor((all other work that can go first) / m). Responses above the period are bounded, up
/// to 16 periods, where no job is skipped and no data of two instances mix.
[[nodiscard]] Method dag_groups();

}  // namespace redag::analysis
