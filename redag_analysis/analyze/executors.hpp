// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Selects the bounds that hold under an executor: ours, or a model of one of rclcpp's (redag_analysis/executors).
// `redag analyze`, reports and runs all ask here. Pure functions.
#pragma once

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/executors/executors.hpp"

namespace redag::analysis {

/// The bounds that hold only for rclcpp's single- and multi-threaded executors: the baselines.
[[nodiscard]] const std::vector<Method> &executor_methods();

/// Returns methods() for our executor. A peer gets the bounds for any work-conserving order without preemption, which
/// all peers have, and those known for it alone. Proofs: docs/analysis.md, "rclcpp's executors".
[[nodiscard]] const std::vector<Method> &methods_of(const executors::ExecutorKind &executor);

/// The platform that the executor makes of `platform`: executors::effective_config().
[[nodiscard]] AnalysisPlatform effective_platform(const executors::ExecutorKind &executor, AnalysisPlatform platform);

/// Compiles what the executor sees: peers do not know max_active. Errors: those of compile().
[[nodiscard]] Result<TaskSet> compile_for(const executors::ExecutorKind &executor, const Workload &workload,
                                          const AnalysisPlatform &platform);

}  // namespace redag::analysis
