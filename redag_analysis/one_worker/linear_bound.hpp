// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A response-time bound in linear time, without a fixed point: R_i <= (B_i + C_i + sum_{j < i} C_j (1 - U_j)) / (1 -
// sum_{j < i} U_j), where sum_{j <= i} U_j <= 1. E. Bini, T. H. C. Nguyen, P. Richard, S. Baruah, IEEE Transactions on
// Computers 58(2), 2009.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// One worker, full preemption, static priorities, any deadlines, no jitter. O(n) a task.
[[nodiscard]] Method linear_bound();

}  // namespace redag::analysis
