// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How long a machine takes a processor away from a thread that wants nothing else: a thread on each processor reads the
// clock without end and notes the gaps, as Linux's osnoise tracer does. Owns its threads while it runs. Blocks.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/model/overheads.hpp"

namespace redag::runtime {

/// Shorter gaps are the loop's own.
inline constexpr Duration kShortestGap = 2 * kMicrosecond;

struct Gap {
  Duration at = 0;       // of the time that was watched: when it ended
  Duration length = 0;   // of the clock
  Duration charged = 0;  // of the thread's processor time: what the kernel did in its name
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

/// All processors that the process may use, at once. SCHED_FIFO threads pause a fifth of the time, so that the kernel
/// does not throttle them. Error: the threads cannot be made.
[[nodiscard]] Result<std::vector<WatchedProcessor>> watch_for_stalls(const StallOptions &options);

/// One time at which something was lost.
struct LossSample {
  Duration at = 0;
  Duration length = 0;
};

/// The leaky bucket that all of them fit in: it leaks twice the mean of what was lost in `watched`, and is as large as
/// the highest level that it came to. In order of time.
[[nodiscard]] Loss fit_loss(std::span<const LossSample> samples, Duration watched);

}  // namespace redag::runtime
