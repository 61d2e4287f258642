// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests that compare utilizations with a limit: O(n) or nearly so, and sufficient only. Those for one worker take a DAG
// of one rate as one task with C = its volume. Rounding neither accepts nor refuses a set (exact_utilization.hpp).
#pragma once

#include <optional>
#include <string>

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Returns why Liu and Layland's limit says nothing about the task set; empty if it is a sound test. C. Liu, J.
/// Layland, Journal of the ACM 20(1), 1973: one worker, full preemption, rate-monotonic order, D >= T, no jitter, no
/// blocking.
[[nodiscard]] std::optional<std::string> why_not_liu_layland(const TaskSet &task_set);

/// For each i: prod_{j < i} (U_j + 1) (U_i + B_i / T_i + 1) <= 2. E. Bini, G. Buttazzo, G. Buttazzo, IEEE Transactions
/// on Computers 52(7), 2003, with the blocking of L. Sha, R. Rajkumar, J. Lehoczky, ibid. 39(9), 1990. Holds also for
/// jobs that cannot be preempted: docs/analysis.md, "Utilization".
[[nodiscard]] Method hyperbolic_blocking();

/// m >= 2 workers: U <= (m / 2) (1 - u) + u with u = max U_i. M. Bertogna, M. Cirinei, G. Lipari, OPODIS 2005.
[[nodiscard]] Method global_rm_utilization();

}  // namespace redag::analysis
