// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Judges what the kernel ran by what was decided: at every instant the processors belong to the most urgent started
// jobs. Levels come from a scheduler that was told the same (RecordingScheduler), what ran from the kernel's record, so
// that neither the engine nor its trace has a say. A pure function.
//
// A job waits while it could run (it was preempted, or dispatched and not begun) and has no processor. That is a
// violation if a job of a strictly less urgent level runs meanwhile, or a processor idles, while each processor serves
// its timer kBeats times. Wall-clock time has no say: a processor that the hypervisor took serves no timer.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag_testing/recording_scheduler.hpp"
#include "redag_testing/switch_record.hpp"

namespace redag::testing {

inline constexpr Duration kBeat = 500 * kMicrosecond;
inline constexpr std::uint32_t kBeats = 8;  // 4 ms, where nobody takes the processors away

/// A body as it saw itself. It must not wait for anything but the engine.
struct BodyRun {
  JobKey job;
  pid_t thread = 0;
  Time begin = 0;
  Time end = kNever;  // kNever: it had not ended
};

struct KernelRun {
  std::vector<SwitchEvent> events;  // by time
  std::vector<BodyRun> bodies;
  std::vector<Decision> decisions;  // by time
  std::vector<int> cpus;            // those of the jobs: all in `events`
  Time end = kNever;                // nothing is judged from here on
  /// Whose waiting counts; empty: everybody's.
  std::function<bool(std::uint32_t task)> judged;
};

struct KernelVerdict {
  std::uint64_t instants = 0;   // changes of what ran or was to run, with jobs in progress
  std::uint64_t contended = 0;  // of them, with a job that waited
  std::uint64_t violation_count = 0;
  std::vector<std::string> violations;  // the first ones
};

[[nodiscard]] KernelVerdict judge(const KernelRun &run);

}  // namespace redag::testing
