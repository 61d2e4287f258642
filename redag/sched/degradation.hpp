// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Decides which releases HI mode lets through (docs/model.md, "Criticality"). Pure functions without state.
#pragma once

#include <limits>

#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::sched {

/// Stands for "no release was let through yet".
inline constexpr Time kNoRelease = std::numeric_limits<Time>::min();

/// Returns true if a release of a timer task of a degraded DAG is let through. `last` is the newest release that this
/// HI mode has let through for the tasks on the same grid, or kNoRelease. `period` must be positive.
[[nodiscard]] bool lets_through(const Degrade &degrade, Duration period, Time last, Time release);

}  // namespace redag::sched
