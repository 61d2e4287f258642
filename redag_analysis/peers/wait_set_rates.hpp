// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds for rclcpp's own executors (redag_analysis/executors/wait_set.hpp) that use rates: a published one for one
// thread, and one for several threads. For comparison: executor_methods(), not methods(). Pure functions.
//
// The papers assume a supply of processor time and poll subscriptions only. Here each thread has a processor, and every
// task is a polled callback, because since Humble timers wait in the same windows, before subscriptions. A task arrives
// when it is ready: J_i after its unit's release at the latest. The J_i follow from its predecessors' responses, until
// all agree. A DAG answers within its tasks' largest J_i + R_i. Nothing is bounded unless J_i + R_i <= T_i for all
// tasks.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// One thread. eta_i(d) = ceil((d + J_i) / T_i) jobs arrive in d instants. For a job that arrives A after the begin of
/// a busy window, the least R with A + R >= C_i eta_i(A + 1) + sum_j C_j eta_j(A + R - C_i + 1); the bound is the
/// largest over all A. Every other callback delays it, whatever its priority. D. Casini, T. Blass, I. Luetkebohle, B.
/// Brandenburg, ECRTS 2019, lemmas 4 to 7. With the requirement above it is the sum of all C (proof: docs/analysis.md,
/// "rclcpp's executors").
[[nodiscard]] Method casini();

/// m threads: R_i = C_i + floor(sum_j min(W_j(R_i - C_i + 1), (1 + h_ij) C_j) / m). Never above wait_set() and, with
/// one thread, theorem 2 of T. Blass, D. Casini, S. Bozhko, B. Brandenburg, RTSS 2021, for single callbacks. Stands for
/// X. Jiang et al., RTSS 2022, and H. Sobhani, H. Choi, H. Kim, RTAS 2023, whose text was not available: global
/// non-preemptive interference by all others. Proof: docs/analysis.md, "rclcpp's executors".
[[nodiscard]] Method wait_set_rates();

}  // namespace redag::analysis
