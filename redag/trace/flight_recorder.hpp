// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A record of a run that survives its process: events are written to disk during the run, and recover() makes a trace
// of them. Appended events survive if the process is killed. If the machine loses power, those appended at least
// a second before survive. Files: docs/results_format.md. One thread appends; a thread of the recorder waits for the
// disk. Neither is a real-time thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

struct FlightOptions {
  std::uint64_t most_bytes = std::uint64_t{256} << 20U;  // of events on disk; beyond that the newest replace the oldest
  Duration sync_every = kSecond;                         // between two waits for the disk, while there are new events
};

class FlightRecorder {
 public:
  /// Creates `folder` in an existing one, and writes `info` there. Errors: an invalid workload, an unwritable place, a
  /// record that is already there. `positions` is that of describe().
  [[nodiscard]] static Result<FlightRecorder> create(const std::string &folder, const RunInfo &info,
                                                     const FlightOptions &options = {},
                                                     std::span<const std::uint32_t> positions = {});

  FlightRecorder(FlightRecorder &&) noexcept;
  FlightRecorder &operator=(FlightRecorder &&) = delete;
  FlightRecorder(const FlightRecorder &) = delete;
  FlightRecorder &operator=(const FlightRecorder &) = delete;
  /// Keeps the record. Call remove_flight_record() once the trace is kept elsewhere.
  ~FlightRecorder();

  /// Replaces the description of the run, for example after tasks were added. With `positions`, the events use the
  /// driver's task ids, and task i is at positions[i] in the workload. Errors: as create().
  [[nodiscard]] Result<void> describe(const RunInfo &info, std::span<const std::uint32_t> positions = {});

  /// Appends events, and how many the rings have lost so far. Reports an error once, if the disk is full or broken, and
  /// writes nothing from then on.
  [[nodiscard]] Result<void> append(std::span<const JobEvent> events, std::uint64_t lost_events);

 private:
  class Impl;
  explicit FlightRecorder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// The recovered part of a run.
struct Recovered {
  Trace trace;                    // ends at the last instant that was recorded completely
  std::uint64_t overwritten = 0;  // older events, replaced by newer ones; also in trace.info.lost_events
  std::uint64_t damaged = 0;      // blocks that were not written completely; the blocks after them are not used
};

/// Reads the record in `folder`. `end_of_run`: of one that has ended, all of whose events were appended; the trace
/// then ends there. Errors: there is no record, it is still being written, or it has another format.
[[nodiscard]] Result<Recovered> recover(const std::string &folder, Time end_of_run = kNever);

/// Returns true if there is a record in `folder`.
[[nodiscard]] bool has_flight_record(const std::string &folder);

/// Renames a record that an earlier run has left in `folder` to the first free of "<folder>.1", "<folder>.2", ... and
/// returns the new name; empty if there is none. Error: what the system refused.
[[nodiscard]] Result<std::string> move_record_aside(const std::string &folder);

/// Deletes a record that is not being written. Error: what the system refused.
[[nodiscard]] Result<void> remove_flight_record(const std::string &folder);

}  // namespace redag::trace
