// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a machine adds to the jobs of a workload, as `redag calibrate` measures it, and the file that holds it
// (docs/calibration.md). Plain values; nothing here knows how they are measured or charged. Pure functions, except for
// the file that is read.
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

/// Time lost in any window of length x: at most `longest + x * per_second / 1s`, as a leaky bucket.
struct Loss {
  Duration longest = 0;
  Duration per_second = 0;

  /// The bound for a window; kMaxDuration at most.
  [[nodiscard]] Duration in(Duration window) const;

  friend bool operator==(const Loss &, const Loss &) = default;
};

/// Of threads of one scheduling class. All are measured maxima: evidence, and no proof.
struct Overheads {
  Duration timer = 0;     // processor time of the release timer for each release, on some processor
  Duration dispatch = 0;  // from a decision to the first instruction of the job that it starts
  Duration preempt = 0;   // from the end of a more urgent job to the preempted job going on
  Duration lateness = 0;  // a timer's release is seen up to so much after its nominal time
  Loss stall;             // of one processor: kernel, hypervisor, other programs
  Loss noise;             // the part of it that a thread's clock charges to the job that it hit
  Duration clock = 0;     // a thread's clock: resolution and cost of a reading

  friend bool operator==(const Overheads &, const Overheads &) = default;
};

/// "timer 4us, dispatch 60us, preempt 9us, lateness 0.1ms, stall 350us, ..."; parse_overheads() gives it back.
[[nodiscard]] std::string to_string(const Overheads &overheads);
[[nodiscard]] std::optional<Overheads> parse_overheads(std::string_view text);

/// The same names in the file; null for another one.
[[nodiscard]] const std::vector<std::string_view> &overhead_names();
[[nodiscard]] Duration *overhead_named(Overheads &overheads, std::string_view name);

/// What no Linux machine that somebody uses for real-time work should exceed: what an uncalibrated one is granted
/// before a late response is called an alarm. Never charged to a bound.
[[nodiscard]] const Overheads &plausible_overheads();

/// How one quantity was distributed.
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

/// Do jobs of our executor run on SCHED_FIFO threads where a workload asks for this mode, if they may?
[[nodiscard]] constexpr bool is_realtime(PreemptionMode mode) {
  return mode == PreemptionMode::Os || mode == PreemptionMode::Auto;
}

/// A machine's overheads, and where they come from.
struct Calibration {
  std::optional<Overheads> realtime;  // SCHED_FIFO threads; nothing: the process had no right to them
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
  bool complete = true;  // false: ended early; maxima of what was seen until then
  std::vector<Measured> measured;

  /// "overheads of 2026-11-23T08:30:00Z on host (idle and loaded, 30s)".
  [[nodiscard]] std::string provenance() const;
  /// What is charged to jobs on such threads. Error: they were not measured.
  [[nodiscard]] Result<Overheads> of(bool realtime_threads) const;

  friend bool operator==(const Calibration &, const Calibration &) = default;
};

[[nodiscard]] std::string to_yaml(const Calibration &calibration);
/// Errors: every mistake by line, or why the file cannot be read.
[[nodiscard]] Result<Calibration> load_calibration(const std::filesystem::path &path);
[[nodiscard]] Result<Calibration> parse_calibration(std::string_view text, std::string file_name);

}  // namespace redag
