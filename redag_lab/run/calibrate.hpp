// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures what this machine adds to jobs: the runtime itself runs a workload made for it, and its trace tells how late
// releases, dispatches and resumptions were; stall_probe.hpp tells what the machine takes besides. Blocks for as long
// as it was told. Nothing else should run meanwhile, unless that is what is to be measured.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>

#include "redag/base/result.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/overheads.hpp"
#include "redag/model/workload.hpp"
#include "redag_lab/run/stall_probe.hpp"

namespace redag::runtime {

struct CalibrateOptions {
  Duration duration = 30 * kSecond;
  bool loaded = false;                      // half of the time with threads that keep the machine busy
  const std::atomic<bool> *stop = nullptr;  // ends it early, with what there is
  /// Between measurements, at least every few seconds: the share that is done, and what comes next.
  std::function<void(double done, const char *next)> progress;
};

/// Without `date`, `host`, `kernel` and `version`, which are the caller's. Not complete if it was stopped; a class of
/// threads of which something was not measured is left out. Error: threads cannot be made, or nothing was measured.
[[nodiscard]] Result<Calibration> calibrate(const CalibrateOptions &options);

// ---- the parts, for tests ----

/// The workload that is run: short jobs at high rates over long ones that fill half of the workers' time.
[[nodiscard]] Workload calibration_workload(std::uint32_t workers);

/// A stretch in which a body did not run.
struct Absence {
  Time begin = 0;
  Time end = 0;
};

/// `at`: when the decision was made; in order of it.
struct TraceFigures {
  std::vector<Duration> lateness;    // of timers' releases
  std::vector<LossSample> dispatch;  // from the decision to the body's first instruction
  std::vector<LossSample> preempt;   // from the decision to resume a job to its going on
};

/// What is charged to every job for delays like these: their 99th percentile. What one takes beyond it is a stall that
/// it met, and is charged as such: `beyond`, of so much watched time.
[[nodiscard]] Duration usual_delay(std::span<const LossSample> delays, Duration watched, Loss &beyond);

/// `absences`: by TaskId, in order of time; of tasks that do not note theirs, none.
[[nodiscard]] TraceFigures figures_of(const Workload &workload, std::span<const JobEvent> events,
                                      const std::vector<std::vector<Absence>> &absences);

}  // namespace redag::runtime
