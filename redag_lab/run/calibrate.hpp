// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures the overheads that this machine adds to jobs. The runtime runs a workload made for the purpose, and its
// trace shows how late releases, dispatches and resumptions were. Then a thread on each processor reads the clock
// without end, and the gaps show what else takes processors away. Blocks for the requested duration. Meanwhile nothing
// else should run, unless its effect is to be measured.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/loader/calibration.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag::lab {

struct CalibrateOptions {
  Duration duration = 30 * kSecond;
  const std::atomic<bool> *stop = nullptr;  // ends the measurement early
  /// Called between measurements, at least every few seconds, with the share that is done and the next measurement's
  /// name.
  std::function<void(double done, const char *next)> progress;
};

/// Measures the overheads. The caller adds `date`, `host`, `kernel` and `version`. The result leaves out a class of
/// threads of which something was not measured. Error: threads cannot be created, nothing was measured, or the
/// measurement was stopped.
[[nodiscard]] Result<Calibration> calibrate(const CalibrateOptions &options);

// ---- the parts, exposed for tests ----

/// Returns the workload that calibrate() runs: short jobs at high rates above long ones that fill half of the workers'
/// time.
[[nodiscard]] Workload calibration_workload(std::uint32_t workers);

/// An interval in which a body did not run.
struct Absence {
  Time begin = 0;
  Time end = 0;
};

/// A loss of `length` at the instant `at`.
struct LossSample {
  Duration at = 0;
  Duration length = 0;
};

/// Returns a leaky bucket in which all samples fit. It leaks at twice the mean rate of the losses in `watched` time,
/// and is as large as its highest level. Requires samples in order of time.
[[nodiscard]] Loss fit_loss(std::span<const LossSample> samples, Duration watched);

/// Delays found in a trace. `at` is the instant of the decision; samples are in order of it.
struct TraceFigures {
  std::vector<Duration> lateness;    // of timer releases
  std::vector<LossSample> dispatch;  // from the decision to the body's first instruction
  std::vector<LossSample> preempt;   // from the decision to resume a job until it continues
};

/// Returns the delay to charge to every job: the 99th percentile. The excess of longer delays counts as stalls: sets
/// `beyond` to the loss that fits it in `watched` time.
[[nodiscard]] Duration usual_delay(std::span<const LossSample> delays, Duration watched, Loss &beyond);

/// Extracts the delays from a trace. `absences` is indexed by TaskId, in order of time; tasks that do not record theirs
/// have none.
[[nodiscard]] TraceFigures figures_of(const Workload &workload, std::span<const JobEvent> events,
                                      const std::vector<std::vector<Absence>> &absences);

}  // namespace redag::lab
