// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The exact test of Bini and Buttazzo: the demand at a small set of points decides, without a fixed point. P_0(t) =
// {t}, P_i(t) = P_{i-1}(floor(t / T_i) T_i) u P_{i-1}(t); task i is schedulable iff for some t in P_{i-1}(D_i): B_i +
// C_i + sum_{j < i} ceil(t / T_j) C_j <= t. E. Bini, G. Buttazzo, IEEE Transactions on Computers 53(11), 2004.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// One worker, full preemption, static priorities, D <= T, no jitter. Up to 2^n points; gives up above a million.
[[nodiscard]] Method exact_points();

}  // namespace redag::analysis
