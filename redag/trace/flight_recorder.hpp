// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A record of a run that survives its process: events are written to disk while the run goes on, and recover() makes a
// trace of them. What has been appended is kept if the process is killed; what was appended a second before is kept
// if the machine loses power. Files: docs/results_format.md. One thread appends; a second one, of the recorder's own,
// waits for the disk. Neither is a real-time thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

struct FlightOptions {
  std::uint64_t most_bytes = std::uint64_t{256} << 20U;  // of events on disk; then the newest replace the oldest
  Duration sync_every = kSecond;                         // between two waits for the disk, while there is news
};

class FlightRecorder {
 public:
  /// Makes `folder`, in one that exists, and writes `info` there. Errors: an invalid workload, an unwritable place,
  /// a record that is there already. `positions`: as in describe().
  [[nodiscard]] static Result<FlightRecorder> create(const std::string &folder, const RunInfo &info,
                                                     const FlightOptions &options = {},
                                                     std::span<const std::uint32_t> positions = {});

  FlightRecorder(FlightRecorder &&) noexcept;
  FlightRecorder &operator=(FlightRecorder &&) = delete;
  FlightRecorder(const FlightRecorder &) = delete;
  FlightRecorder &operator=(const FlightRecorder &) = delete;
  /// The record stays: remove_flight_record() once the trace is kept elsewhere.
  ~FlightRecorder();

  /// Replaces the description of the run: tasks were added, say. With `positions` the events name tasks by ids of the
  /// driver's own, and task i is at positions[i] in the workload. The same errors as create().
  [[nodiscard]] Result<void> describe(const RunInfo &info, std::span<const std::uint32_t> positions = {});

  /// Writes events that follow the earlier ones, and how many the rings have lost so far. Error, once: the disk is full
  /// or broken; from then on nothing is written.
  [[nodiscard]] Result<void> append(std::span<const JobEvent> events, std::uint64_t lost_events);

 private:
  class Impl;
  explicit FlightRecorder(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// What is left of a run.
struct Recovered {
  Trace trace;                    // ends at the last instant that was recorded whole
  std::uint64_t overwritten = 0;  // older events, replaced by newer ones; counted in trace.info.lost_events too
  std::uint64_t damaged = 0;      // blocks that were not written whole, and what follows them is not used
};

/// Reads the record in `folder`. Errors: there is none, it is still being written, it is not one of ours.
[[nodiscard]] Result<Recovered> recover(const std::string &folder);

/// Is there a record in `folder`?
[[nodiscard]] bool has_flight_record(const std::string &folder);

/// Deletes a record that nobody writes. Error: what the system refused.
[[nodiscard]] Result<void> remove_flight_record(const std::string &folder);

}  // namespace redag::trace
