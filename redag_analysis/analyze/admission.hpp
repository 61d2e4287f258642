// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Decides whether another DAG can be added at run time without a missed deadline. Pure function; its cost is that of
// analyze().
#pragma once

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::analysis {

/// Succeeds if a sound method shows that every deadline of `workload` is met under `config`. The error names the tasks
/// for which nothing shows it. Fits runtime::ExecutorOptions::admission; for a mere warning, wrap it and return {}.
[[nodiscard]] Result<void> admit_by_bounds(const Workload &workload, const sched::Config &config);

}  // namespace redag::analysis
