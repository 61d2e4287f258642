// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What kept chosen jobs from ending at every instant, as the decisions in a trace tell it: one pass over the events.
// Internal to metrics/.
#pragma once

#include <vector>

#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/why_cause.hpp"
#include "redag_analysis/metrics/why_links.hpp"

namespace redag::metrics {

/// A stretch between two decisions. Cause::Predecessor: the job lacked data. Cause::Execution: it had a worker.
struct Wait {
  Cause cause = Cause::Unknown;
  JobId by;
  Time begin = 0;
  Time end = 0;
};

/// Returns for each job of `links` the stretches from when its release was seen to its end, in order of time. Jobs for
/// which `chosen` is false get none.
[[nodiscard]] std::vector<std::vector<Wait>> waits_of(const trace::Trace &trace, const JobLinks &links,
                                                      const std::vector<bool> &chosen);

}  // namespace redag::metrics
