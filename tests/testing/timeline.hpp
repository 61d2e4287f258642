// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs of the simulator, and schedules as text for golden tests: where and when each job ran, a line per job, readable
// in a failure message.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "redag/sched/scheduler.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/sim/simulator.hpp"

namespace redag::testing {

/// How an executor runs the workload; without an end.
[[nodiscard]] trace::RunInfo run_info(Workload workload, const std::string &executor = "redag", std::uint64_t seed = 1);

/// Simulates such a run, with its seed.
[[nodiscard]] trace::Trace simulated(trace::RunInfo info, Duration horizon, sim::Options options = {});

/// Returns every event of a simulation with our scheduler.
[[nodiscard]] std::vector<JobEvent> simulate_events(const Workload &workload, Duration horizon,
                                                    const sim::Options &options = {});

/// One line per started job, in order of dispatch: "lo#0 w0 0-2 w1 5-6". It gives the worker and the milliseconds, cut
/// at preemptions; "5-" is still running. Then follow lines for skipped and aborted jobs: "lo#1 skipped overrun 20".
[[nodiscard]] std::string timeline(const Workload &workload, std::span<const JobEvent> events);

}  // namespace redag::testing
