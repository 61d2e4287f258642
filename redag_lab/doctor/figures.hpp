// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// From what was measured to what is charged: the delays in a recorded trace, and losses of processor time as leaky
// buckets. Pure functions.
#pragma once

#include <span>
#include <vector>

#include "redag/derived/overheads.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag::doctor {

/// A loss of `length` at the instant `at`.
struct LossSample {
  Duration at = 0;
  Duration length = 0;
};

/// Returns a leaky bucket in which all samples fit. It leaks at twice the mean rate of the losses in `watched` time,
/// and is as large as its highest level. Requires samples in order of time.
[[nodiscard]] Loss fit_loss(std::span<const LossSample> samples, Duration watched);

/// Returns the delay to charge to every job: the 99th percentile. The excess of longer delays counts as stalls: sets
/// `beyond` to the loss that fits it in `watched` time. Requires a sample.
[[nodiscard]] Duration usual_delay(std::span<const LossSample> delays, Duration watched, Loss &beyond);

/// Raises both parts of `loss` to those of `other`.
void take_larger(Loss &loss, const Loss &other);

/// An interval in which a body did not run.
struct Absence {
  Time begin = 0;
  Time end = 0;
};

/// Delays found in a trace. `at` is the instant of the decision; samples are in order of it.
struct TraceFigures {
  std::vector<Duration> lateness;    // of timer releases
  std::vector<LossSample> dispatch;  // from the decision to the body's first instruction
  std::vector<LossSample> preempt;   // from the decision to resume a job until it continues
};

/// Extracts the delays from a trace. `absences` is indexed by TaskId, in order of time; tasks that do not record theirs
/// have none.
[[nodiscard]] TraceFigures figures_of(const Workload &workload, std::span<const JobEvent> events,
                                      const std::vector<std::vector<Absence>> &absences);

}  // namespace redag::doctor
