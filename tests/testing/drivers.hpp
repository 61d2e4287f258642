// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// All drivers behind one interface, for suites that run the same workload on each of them.
#pragma once

#include <cstdint>
#include <string>

#include "redag/sched/scheduler.hpp"
#include "redag/trace/trace.hpp"

namespace redag::testing {

struct RunSpec {
  Workload workload;
  std::string executor = "redag";  // as in redag_analysis/executors/executors.hpp
  sched::Preemption preemption = sched::Preemption::None;
  Duration horizon = kSecond;
  std::uint64_t seed = 1;
};

/// Virtual time: redag_analysis/sim.
struct SimulatorDriver {
  static trace::Trace run(const RunSpec &spec);
};

/// Virtual time in which jobs end, and reach preemption points, at random times. With full preemption they can do so
/// while they count as preempted, as on a real machine. Releases are on the grid; some are seen late, and some are
/// missed. Every other run is stepped: jobs are sometimes held back and started one by one. The last task is added
/// while running if possible.
struct ManualDriver {
  static trace::Trace run(const RunSpec &spec);
};

/// Real threads: redag/runtime. Full preemption needs real-time rights.
struct ThreadsDriver {
  static trace::Trace run(const RunSpec &spec);
};

[[nodiscard]] sched::Config config_of(const RunSpec &spec);

}  // namespace redag::testing
