// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Judges what the kernel ran against the decisions: at every instant the processors belong to the most urgent started
// jobs. Levels come from a scheduler that got the same calls (RecordingScheduler), and what ran from the kernel's
// record. Neither the engine nor its trace is consulted. A pure function.
//
// A job waits while it could run (preempted, or dispatched and not begun) and has no processor. This is a violation if,
// while each processor serves its timer kBeats times, a strictly less urgent job runs or a processor idles. Wall-clock
// time does not count: a processor that the hypervisor took serves no timer.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/testing/recording_scheduler.hpp"
#include "tests/testing/switch_record.hpp"

namespace redag::testing {

inline constexpr Duration kBeat = 500 * kMicrosecond;
inline constexpr std::uint32_t kBeats = 8;  // 4 ms, unless the processors are taken away

/// A body as its own thread saw it. It must wait for nothing but the engine.
struct BodyRun {
  JobKey job;
  pid_t thread = 0;
  Time begin = 0;
  Time end = kNever;  // kNever: it has not ended
};

struct KernelRun {
  std::vector<SwitchEvent> events;  // by time
  std::vector<BodyRun> bodies;
  std::vector<Decision> decisions;  // by time
  std::vector<int> cpus;            // the processors of the jobs; `events` has all of them
  Time end = kNever;                // nothing is judged from then on
};

struct KernelVerdict {
  std::uint64_t instants = 0;   // changes of what ran or had to run, with jobs in progress
  std::uint64_t contended = 0;  // those instants with a waiting job
  std::uint64_t violation_count = 0;
  std::vector<std::string> violations;  // only the first ones
};

[[nodiscard]] KernelVerdict judge(const KernelRun &run);

}  // namespace redag::testing
