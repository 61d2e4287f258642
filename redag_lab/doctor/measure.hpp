// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures what this machine adds to jobs. Threads on all processors sleep, and show how late they wake up. The runtime
// runs a workload made for the purpose, and its trace shows how late releases, dispatches and resumptions were. Threads
// on all processors read the clock without end, and the gaps show what else takes processors away. Blocks for the
// requested duration. Meanwhile nothing else should run, unless its effect is to be measured.
#pragma once

#include <atomic>
#include <functional>

#include "redag/base/histogram.hpp"
#include "redag/base/result.hpp"
#include "redag/loader/calibration.hpp"

namespace redag::doctor {

inline const std::atomic<bool> kUnstoppable{false};

struct MeasureOptions {
  Duration duration = 10 * kSecond;
  const std::atomic<bool> *stop = &kUnstoppable;  // ends the measurement early
  /// Called between measurements, at least every few seconds, with the share that is done and the next measurement's
  /// name.
  std::function<void(double done, const char *next)> progress;
};

struct Measurement {
  Calibration calibration;
  HistogramCounts wake_ups;  // how late threads woke up: SCHED_FIFO threads where the process may have them
};

/// Measures. The caller adds `date`, `host`, `kernel` and `version`. The calibration leaves out a class of threads of
/// which something was not measured. Error: threads cannot be created, nothing was measured, or the measurement was
/// stopped.
[[nodiscard]] Result<Measurement> measure(const MeasureOptions &options);

}  // namespace redag::doctor
