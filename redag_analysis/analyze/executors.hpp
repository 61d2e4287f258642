// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which bounds hold under which executor: ours, or a model of one of rclcpp's (sched/models). The one place that
// `redag analyze`, reports and runs ask. Pure functions.
#pragma once

#include "redag_analysis/core/bound.hpp"
#include "redag_analysis/executors/executors.hpp"

namespace redag::analysis {

/// The baselines: those for rclcpp's single- and multi-threaded executors and nothing else.
[[nodiscard]] const std::vector<Method> &executor_methods();

/// methods() for ours. For a peer those that hold for any work-conserving order without preemption, as all of them keep
/// it, and what is known of its own. Proofs: docs/analysis.md, "rclcpp's executors".
[[nodiscard]] const std::vector<Method> &methods_of(const sched::ExecutorKind &executor);

/// The platform that the executor makes of `platform`: sched::effective_config().
[[nodiscard]] AnalysisPlatform effective_platform(const sched::ExecutorKind &executor, AnalysisPlatform platform);

/// What the executor sees: peers do not know max_active. Errors: compile().
[[nodiscard]] Result<System> compile_for(const sched::ExecutorKind &executor, const Workload &workload,
                                         const AnalysisPlatform &platform);

}  // namespace redag::analysis
