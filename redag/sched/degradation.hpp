// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which releases HI mode lets through (docs/model.md, "Criticality"). A pure function.
#pragma once

#include <limits>

#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::sched {

/// In place of a release: none was let through yet.
inline constexpr Time kNoRelease = std::numeric_limits<Time>::min();

/// Is this release of a timer task of a degraded DAG taken? `last`: the newest release that was, in this HI mode, of
/// the tasks that share the task's grid; kNoRelease: none. `period`: positive.
[[nodiscard]] bool lets_through(const Degrade &degrade, Duration period, Time last, Time release);

}  // namespace redag::sched
