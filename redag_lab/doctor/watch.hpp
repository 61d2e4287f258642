// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a thread sees that does nothing but watch its processor, for `length` or until `stop`.
#pragma once

#include <atomic>
#include <vector>

#include "redag/base/histogram.hpp"
#include "redag/base/time.hpp"
#include "redag_lab/doctor/figures.hpp"

namespace redag::doctor {

/// An interval in which a thread that reads the clock without end did not run.
struct Gap {
  Duration at = 0;       // its end, in watched time
  Duration length = 0;   // wall-clock time
  Duration charged = 0;  // processor time charged to the thread: the kernel's work in its name
};

/// Shorter gaps are caused by the loop that reads the clock.
inline constexpr Duration kShortestGap = 2 * kMicrosecond;

struct WatchedProcessor {
  Duration watched = 0;
  std::vector<Gap> gaps;

  /// Returns the losses of one kind, Gap::length or Gap::charged, as a leaky bucket.
  [[nodiscard]] Loss loss(Duration Gap::*part) const;
};

/// Reads the clock without end, as Linux's osnoise tracer does, and adds the gaps to `processor`.
void watch_gaps(Duration length, const std::atomic<bool> &stop, WatchedProcessor &processor);

/// Sleeps for a millisecond at a time, as cyclictest does, and counts how late it woke up.
void watch_wake_ups(Duration length, const std::atomic<bool> &stop, Histogram &latencies);

}  // namespace redag::doctor
