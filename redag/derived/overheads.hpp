// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a machine adds to the jobs of a workload, as `redag doctor --measure` measures it (docs/calibration.md). Plain
// values, without knowledge of how they are measured or charged. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag {

/// Time lost in any window of length x: at most `longest + x * per_second / 1s` (a leaky bucket).
struct Loss {
  Duration longest = 0;
  Duration per_second = 0;

  /// Returns the bound for a window, at most kMaxDuration.
  [[nodiscard]] Duration in(Duration window) const;

  friend bool operator==(const Loss &, const Loss &) = default;
};

/// Overheads of threads of one scheduling class. All are measured maxima: evidence, not proof.
struct Overheads {
  Duration timer = 0;     // processor time of the release timer for each release, on any processor
  Duration dispatch = 0;  // from a decision to the first instruction of the job that it starts
  Duration preempt = 0;   // from the end of a more urgent job until the preempted job continues
  Duration lateness = 0;  // most delay between a timer release's nominal time and when it is seen
  Loss stall;             // of one processor: kernel, hypervisor, other programs
  Loss noise;             // the part of `stall` that a thread's clock charges to the job that it hit
  Duration clock = 0;     // a thread's clock: resolution and cost of a reading

  friend bool operator==(const Overheads &, const Overheads &) = default;
};

/// For example "timer 4us, dispatch 60us, preempt 9us, lateness 0.1ms, stall 350us, ..."; parse_overheads() reads it.
[[nodiscard]] std::string to_string(const Overheads &overheads);
[[nodiscard]] std::optional<Overheads> parse_overheads(std::string_view text);

/// The names of the overheads in the file. overhead_named() returns null for any other name.
[[nodiscard]] const std::vector<std::string_view> &overhead_names();
[[nodiscard]] Duration *overhead_named(Overheads &overheads, std::string_view name);

/// The most that a Linux machine used for real-time work should need. An uncalibrated machine is granted this much
/// before a late response raises an alarm. Never charged to a bound.
[[nodiscard]] const Overheads &plausible_overheads();

/// Returns true if jobs of our executor run on SCHED_FIFO threads in this mode, given the rights.
[[nodiscard]] constexpr bool is_realtime(PreemptionMode mode) {
  return mode == PreemptionMode::Os || mode == PreemptionMode::Auto;
}

}  // namespace redag
