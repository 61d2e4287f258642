// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Processor demand on one worker under EDF. Every interval [0, t] must hold the work that is released and due in it:
// h(t) = sum max(0, floor((t + J_i - D_i) / T_i) + 1) C_i <= t. Preemptive jobs are tested by QPA. A job that keeps the
// worker, or reaches a preemption point late, blocks once: h(t) + max_{D_l > t} (region_l - 1) <= t.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Full preemption. S. Baruah, L. Rosier, R. Howell, RTS 2, 1990; F. Zhang, A. Burns, IEEE Transactions on Computers
/// 58(9), 2009 (QPA).
[[nodiscard]] Method edf_demand();

/// Jobs run to completion or to a preemption point. K. Jeffay, D. Stanat, C. Martel, RTSS 1991; L. George, N. Rivierre,
/// M. Spuri, INRIA RR-2966, 1996; M. Bertogna, S. Baruah, IEEE Transactions on Industrial Informatics 6(4), 2010.
[[nodiscard]] Method edf_demand_nonpreemptive();

}  // namespace redag::analysis
