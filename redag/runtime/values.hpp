// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Plain values that the engine and the users of an Executor share.
#pragma once

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

}  // namespace redag::runtime
