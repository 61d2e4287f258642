// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The bound for what no other method covers: any workers, policy and preemption, with all features together. It assumes
// of the others only how many of their jobs can be unfinished, and how many can be released. Proof: docs/analysis.md,
// "Any features".
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Bounds each task from its own release. Where a job can be lost, the bound is that of the jobs that end
/// (ResponseBound::of_ended). A DAG of one grid has a bound if no job of it can be lost.
[[nodiscard]] Method by_demand();

}  // namespace redag::analysis
