// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A bound for rclcpp's own executors as sched/models/wait_set.hpp models them, to compare with: not for our scheduler,
// and so not in methods(). One worker is the SingleThreadedExecutor, more the MultiThreadedExecutor. Pure functions.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Each other callback executes at most once in the window that is being worked through when a job becomes ready, and
/// at most once before it in the next, which holds it (D. Casini, T. Blass, I. Luetkebohle, B. Brandenburg, ECRTS 2019;
/// Y. Tang et al., RTSS 2020); while it waits all m threads execute. A job answers within C_v + floor((sum of the
/// others + sum of those registered before it) / m) of becoming ready, a DAG within the largest sum of these along a
/// path. Holds whatever the others' rates are. Proof: docs/analysis.md, "rclcpp's executors".
[[nodiscard]] Method wait_set();

}  // namespace redag::analysis
