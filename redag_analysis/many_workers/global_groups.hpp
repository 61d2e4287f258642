// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Response times of tasks and DAGs whose tasks share exclusive groups, on one worker or several, with full preemption
// and priority inheritance or run to completion. Within a group jobs run one after the other, so what a chain of jobs
// waits for its groups counts in full, not divided by m. Pure functions.
//
// Assumptions: sporadic releases with jitter; a group is held from a job's start to its end; its holder inherits from
// the most urgent job that waits (L. Sha, R. Rajkumar, J. Lehoczky, IEEE TC 39(9), 1990); no max_active that binds; not
// cooperative. After A. Melani et al., ECRTS 2015 (paths through DAGs), and J. Lehoczky, RTSS 1990 (several instances
// in one window). Proof: docs/analysis.md, "Exclusive groups".
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// For each task, over the chains of jobs that can delay it: R = max over q instances of
/// J + x - (q - 1) T, x = chain + waits for groups + floor((all other work that can go first) / m). Responses above the
/// period are bounded where no job is skipped and no data of two instances mix, up to 16 periods.
[[nodiscard]] Method dag_groups();

}  // namespace redag::analysis
