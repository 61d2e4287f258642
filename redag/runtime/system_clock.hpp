// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the system's clock together with the time of a run, for runs that are merged with those of other hosts.
// Any thread.
#pragma once

#include <algorithm>
#include <ctime>

#include "redag/runtime/clock.hpp"
#include "redag/trace/trace.hpp"

namespace redag::runtime {

/// Returns the closest of a few readings. `now` returns the time of the run, which never decreases.
template <class Now>
[[nodiscard]] trace::ClockReading read_system_clock(Now now) {
  constexpr int kTries = 5;  // a thread that is preempted between the clocks spoils a reading
  trace::ClockReading best{.error = kMaxDuration};
  for (int i = 0; i < kTries; ++i) {
    const Time before = now();
    const Time system = detail::read_clock(CLOCK_REALTIME);
    const Time after = now();
    const Duration error = (after - before + 1) / 2;
    if (error < best.error) best = {.at = before + (after - before) / 2, .system = system, .error = error};
  }
  best.error = std::max<Duration>(best.error, 1);
  return best;
}

}  // namespace redag::runtime
