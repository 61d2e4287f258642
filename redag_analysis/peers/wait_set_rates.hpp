// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds for rclcpp's own executors (sched/models/wait_set.hpp) that look at rates: published ones for one thread, and
// one for several threads. To compare with: executor_methods(), not methods(). Pure functions.
//
// The papers know a supply of processor time; here each thread has a processor to itself. They poll subscriptions only,
// as ROS 2 did then; since Humble timers wait in the same windows, and so every task here is a polled callback, timers
// before subscriptions. A task's arrival is its readiness: J_i after its unit's release at the latest, found with the
// responses of its predecessors until all agree; eta_i(d) = ceil((d + J_i) / T_i) of them come in d instants. A DAG
// answers within the largest J_i + R_i of its tasks. Requires J_i + R_i <= T_i of all tasks, or nothing is bounded.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// One thread. For a job that arrives A after the begin of a busy window, the least R with
/// A + R >= C_i eta_i(A + 1) + sum_j C_j eta_j(A + R - C_i + 1), the largest over all A: every other callback delays
/// it, whatever its priority. D. Casini, T. Blass, I. Luetkebohle, B. Brandenburg, ECRTS 2019, lemmas 4 to 7. With the
/// requirement above that is the sum of all C (proof: docs/analysis.md, "rclcpp's executors").
[[nodiscard]] Method casini();

/// One thread. The least S with S >= 1 + sum_j C_j min(eta_j(S + R_j - 1), p + h_ij) + C_i (eta_i(S + R_i - 1) - 1), p
/// = eta_i(R_i) and h_ij = 1 where j is registered before i; then R_i = S - 1 + C_i: none starves another. T. Blass, D.
/// Casini, S. Bozhko, B. Brandenburg, RTSS 2021, theorem 2, of single callbacks.
[[nodiscard]] Method blass();

/// m threads: R_i = C_i + floor(sum_j min(W_j(R_i - C_i + 1), (1 + h_ij) C_j) / m). Never above wait_set() and, with
/// one thread, blass(). Stands for X. Jiang et al., RTSS 2022, and H. Sobhani, H. Choi, H. Kim, RTAS 2023, whose text
/// was not at hand: global non-preemptive interference by all others. Proof: docs/analysis.md, "rclcpp's executors".
[[nodiscard]] Method wait_set_rates();

}  // namespace redag::analysis
