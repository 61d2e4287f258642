// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a machine adds to the jobs of a workload, as `redag calibrate` measures it, and the file that holds it
// (docs/calibration.md). Plain values, without knowledge of how they are measured or charged. Pure functions, except
// those that read the file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
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

/// The distribution of one measured quantity.
struct Measured {
  std::string what;     // "dispatch"
  std::string threads;  // "realtime", "normal"
  std::string load;     // "idle", "loaded"
  std::uint64_t samples = 0;
  Duration p50 = 0;
  Duration p99 = 0;
  Duration p999 = 0;
  Duration max = 0;

  friend bool operator==(const Measured &, const Measured &) = default;
};

/// Returns true if jobs of our executor run on SCHED_FIFO threads in this mode, given the rights.
[[nodiscard]] constexpr bool is_realtime(PreemptionMode mode) {
  return mode == PreemptionMode::Os || mode == PreemptionMode::Auto;
}

/// A machine's overheads, and their provenance.
struct Calibration {
  std::optional<Overheads> realtime;  // SCHED_FIFO threads; empty: the process had no right to them
  std::optional<Overheads> normal;
  std::string date;  // UTC, ISO 8601
  std::string host;
  std::string kernel;
  std::string processor;
  std::string rights;  // "SCHED_FIFO up to 98", "none"
  std::string load;    // "idle", "idle and loaded"
  std::string version;
  Duration duration = 0;
  std::uint32_t processors = 0;
  bool complete = true;  // false: ended early, with the maxima until then
  std::vector<Measured> measured;

  /// For example "overheads of 2026-11-23T08:30:00Z on host (idle and loaded, 30s)".
  [[nodiscard]] std::string provenance() const;
  /// Returns the overheads charged to jobs on such threads. Error: they were not measured.
  [[nodiscard]] Result<Overheads> of(bool realtime_threads) const;

  friend bool operator==(const Calibration &, const Calibration &) = default;
};

[[nodiscard]] std::string to_yaml(const Calibration &calibration);
/// Errors: all mistakes by line, or why the file cannot be read.
[[nodiscard]] Result<Calibration> load_calibration(const std::filesystem::path &path);
[[nodiscard]] Result<Calibration> parse_calibration(std::string_view text, std::string file_name);

}  // namespace redag
