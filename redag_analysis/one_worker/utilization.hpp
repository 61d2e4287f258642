// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests that compare utilizations with a limit: O(n) or nearly so, and sufficient only. Those for one worker take a DAG
// of one rate as one task with C = its volume. Rounding neither accepts nor refuses a set (exact_utilization.hpp).
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// sum U_i <= n (2^(1/n) - 1). C. Liu, J. Layland, Journal of the ACM 20(1), 1973.
[[nodiscard]] Method liu_layland();

/// prod (U_i + 1) <= 2. E. Bini, G. Buttazzo, G. Buttazzo, IEEE Transactions on Computers 52(7), 2003.
[[nodiscard]] Method hyperbolic();

/// As liu_layland with n replaced by the least number of chains of periods that divide each other. T.-W. Kuo, A. Mok,
/// RTSS 1991.
[[nodiscard]] Method harmonic_chains();

/// For each i: sum_{j <= i} U_j + B_i / T_i <= i (2^(1/i) - 1). L. Sha, R. Rajkumar, J. Lehoczky, IEEE Transactions on
/// Computers 39(9), 1990. Holds also for jobs that cannot be preempted: docs/analysis.md, "Utilization".
[[nodiscard]] Method liu_layland_blocking();

/// For each i: prod_{j < i} (U_j + 1) (U_i + B_i / T_i + 1) <= 2. Holds also for jobs that cannot be preempted.
[[nodiscard]] Method hyperbolic_blocking();

/// m >= 2 workers: U <= m^2 / (3m - 2) and max U_i <= m / (3m - 2). B. Andersson, S. Baruah, J. Jonsson, RTSS 2001.
[[nodiscard]] Method global_rm_light();

/// m >= 2 workers: U <= (m / 2) (1 - u) + u with u = max U_i. M. Bertogna, M. Cirinei, G. Lipari, OPODIS 2005.
[[nodiscard]] Method global_rm_utilization();

}  // namespace redag::analysis
