// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures how long the machine takes a processor away from a thread. A thread on each processor reads the clock
// without end and records the gaps, as Linux's osnoise tracer does. Owns its threads while it runs. Blocks.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/model/overheads.hpp"

namespace redag::lab {

/// Shorter gaps are caused by the loop itself.
inline constexpr Duration kShortestGap = 2 * kMicrosecond;

struct Gap {
  Duration at = 0;       // end of the gap, in watched time
  Duration length = 0;   // wall-clock time
  Duration charged = 0;  // processor time charged to the thread: the kernel's work in its name
};

struct WatchedProcessor {
  int cpu = 0;
  Duration watched = 0;
  std::vector<Gap> gaps;
};

struct StallOptions {
  Duration duration = kSecond;
  int fifo_priority = 0;  // 0: ordinary threads
  const std::atomic<bool> *stop = nullptr;
};

/// Watches all processors that the process may use at the same time. SCHED_FIFO threads pause a fifth of the time to
/// avoid throttling by the kernel. Error: the threads cannot be created.
[[nodiscard]] Result<std::vector<WatchedProcessor>> watch_for_stalls(const StallOptions &options);

/// A loss of `length` at the instant `at`.
struct LossSample {
  Duration at = 0;
  Duration length = 0;
};

/// Returns a leaky bucket in which all samples fit. It leaks at twice the mean rate of the losses in `watched` time,
/// and is as large as its highest level. Requires samples in order of time.
[[nodiscard]] Loss fit_loss(std::span<const LossSample> samples, Duration watched);

}  // namespace redag::lab
