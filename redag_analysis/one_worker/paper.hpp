// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The equations of the ReDAG-RT paper as printed: per callback, one worker's formulas on any platform. They are kept
// for comparison. Each says when its numbers are a bound; elsewhere its answer carries `unsound`, and a report does not
// trust it. Counterexamples: docs/analysis.md, "The paper's equations".
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// eq. rm_bound: U <= N (2^(1/N) - 1) over all N callbacks.
[[nodiscard]] Method paper_rm_bound();

/// eq. interference: R_i = C_i + sum of C_j over the tasks of smaller period, each once.
[[nodiscard]] Method paper_interference();

/// eqs. rta, rta_convergence: R_i = C_i + sum ceil(R_i / T_j) C_j over the tasks of smaller period.
[[nodiscard]] Method paper_rta();

/// eq. rta_blocking: eq. rta + B_i. The paper leaves B_i open; here it is the blocking on one worker (one_worker.hpp).
[[nodiscard]] Method paper_rta_blocking();

}  // namespace redag::analysis
