// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Plain values that the engine shares with the users of an Executor.
#pragma once

#include <cstdint>
#include <string>

#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::runtime {

/// The preemption mode of an executor on this machine.
struct Mode {
  PreemptionMode mode = PreemptionMode::None;  // never Auto
  std::string reason;                          // why; empty: it was asked for
};

/// How long a job may be in progress before the watchdog reports it overdue. The shorter of the given limits holds.
struct WatchLimits {
  Duration longest = 0;  // ns; 0: not given
  double deadlines = 0;  // multiple of the job's relative deadline; 0: not given
};

struct WatchdogOptions {
  WatchLimits limits;
  Duration interval = 10 * kMillisecond;  // ns between two looks
};

/// Processor time of the ended jobs of a task.
struct Usage {
  std::uint64_t jobs = 0;
  Duration total = 0;
  Duration longest = 0;
  std::uint64_t over_wcet = 0;
  std::uint64_t over_budget = 0;
  std::uint64_t overdue = 0;  // jobs that the watchdog reported
};

/// How a deadline was missed.
enum class MissKind : std::uint8_t {
  Late,      // finished after its deadline
  EndToEnd,  // a sink finished after the deadline of its DAG
  Skipped,   // released and never started
  Aborted,   // threw, or was cut off at its budget
};

}  // namespace redag::runtime
