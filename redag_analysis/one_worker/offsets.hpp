// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One worker and static priorities, where timers of one DAG have different offsets: their releases do not all coincide.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// The bounds of rta_*(), the largest of all busy periods that can begin in one cycle of the DAG's timers. Each begins
/// as a release is seen as late as it can be; other DAGs begin at any time. K. Tindell, Adding time-offsets to
/// schedulability analysis, University of York YCS 221, 1994; J. Palencia, M. Gonzalez Harbour, RTSS 1998, section 4.
/// Exact for timers of one DAG without jitter, with different priorities and full preemption. Proof: docs/analysis.md,
/// "Offsets".
[[nodiscard]] Method offsets();

}  // namespace redag::analysis
