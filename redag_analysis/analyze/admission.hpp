// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Is there time for another DAG? For whoever adds some at run time. Pure function; its cost is that of analyze().
#pragma once

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/sched/config.hpp"

namespace redag::analysis {

/// No error: a sound method shows that every deadline of `workload` is met under `config`. An error says of which tasks
/// that is not known. Fits runtime::ExecutorOptions::admission; to be warned only, wrap it and answer {}.
[[nodiscard]] Result<void> admit_by_bounds(const Workload &workload, const sched::Config &config);

}  // namespace redag::analysis
