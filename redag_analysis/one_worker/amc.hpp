// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// AMC-rtb: response times under adaptive mixed criticality (docs/model.md, "Criticality"), one worker, full preemption.
// Three bounds a task: in LO mode, in HI mode, and across the change. O(n) a step, pseudo-polynomial in all.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// S. Baruah, A. Burns, R. Davis, Response-time analysis for mixed criticality systems, RTSS 2011, section IV.A. Tasks
/// of high criticality get a response that holds for every job. The others get only `low` of Bound::modes, for jobs
/// that end in LO mode. Requires executions of at most wcet, or an `abort` budget that enforces this.
[[nodiscard]] Method amc_rtb();

}  // namespace redag::analysis
