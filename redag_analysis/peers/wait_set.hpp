// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A bound for rclcpp's own executors as redag_analysis/executors/wait_set.hpp models them, for comparison. It does not
// hold for our scheduler and is not in methods(). One worker is the SingleThreadedExecutor, more the
// MultiThreadedExecutor. Pure functions.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Each other callback executes at most once in the window that is being worked through when a job becomes ready. It
/// executes at most once before the job in the next window, which holds the job (D. Casini, T. Blass, I. Luetkebohle,
/// B. Brandenburg, ECRTS 2019; Y. Tang et al., RTSS 2020). While the job waits all m threads execute. A job answers
/// within C_v + floor((sum of the others + sum of those registered before it) / m) of becoming ready, a DAG within the
/// largest sum of these along a path. Holds for any rates of the others. Proof: docs/analysis.md, "rclcpp's executors".
[[nodiscard]] Method wait_set();

}  // namespace redag::analysis
