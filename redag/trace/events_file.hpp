// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files of events (events.redag), the lossless form of a trace: blocks of compressed bytes, each with a checksum. The
// first block describes the run. The last one proves that none is missing; it has a fixed length, and a reader finds it
// from the end. A run can be recorded while it goes on: of a file without its end, readers use the whole blocks, and
// say so. Neither side holds more than one block of events. BlockHeader in the source has the layout of blocks, and
// event_codec.hpp that of events. docs/events.md has the meaning. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

class InputFile;
class OutputFile;

/// The most bytes of a record on disk, if nothing else is said.
inline constexpr std::uint64_t kMostRecordBytes = std::uint64_t{256} << 20U;

/// The name of the file in a folder of results.
inline constexpr std::string_view kEventsFile = "events.redag";

/// Writes events as they arrive, for runs that are too long to be kept in memory.
class EventsWriter {
 public:
  /// `info.end` and `info.lost_events` may still be unknown. Errors: an invalid workload, an unwritable place.
  [[nodiscard]] static Result<EventsWriter> create(const std::string &path, const RunInfo &info);

  /// Records a run that may end any time: the file exists at once, and has what was flushed. Beyond `most_bytes` on
  /// disk, the newest events replace the oldest. Replaces a file; see move_unfinished_aside(). `positions` is that of
  /// describe(). Errors: as create().
  [[nodiscard]] static Result<EventsWriter> record(const std::string &path, const RunInfo &info,
                                                   std::uint64_t most_bytes = kMostRecordBytes,
                                                   std::span<const std::uint32_t> positions = {});

  EventsWriter(EventsWriter &&) noexcept;
  EventsWriter &operator=(EventsWriter &&) = delete;
  EventsWriter(const EventsWriter &) = delete;
  EventsWriter &operator=(const EventsWriter &) = delete;
  ~EventsWriter();

  /// Requires events of the run that `info` described.
  void add(std::span<const JobEvent> events);

  /// Of a record: replaces the description of the run, for example after tasks were added. With `positions`, the events
  /// use the driver's task ids, and task i is at positions[i] in the workload. Error: an invalid workload.
  [[nodiscard]] Result<void> describe(const RunInfo &info, std::span<const std::uint32_t> positions = {});

  /// Of a record: writes what was added, so that it survives the process, and how many events the rings have lost so
  /// far. After a loss of power, the last seconds may be missing. Error: a full or broken disk; also in later calls.
  [[nodiscard]] Result<void> flush(std::uint64_t lost_events);

  /// Completes the file. Until then it does not exist, unless it is a record.
  [[nodiscard]] Result<void> commit(Time end, std::uint64_t lost_events);

 private:
  class Impl;
  explicit EventsWriter(std::unique_ptr<Impl> impl);
  [[nodiscard]] static Result<EventsWriter> make(Result<OutputFile> (*open)(std::string), const std::string &path,
                                                 const RunInfo &info, std::uint64_t most_bytes,
                                                 std::span<const std::uint32_t> positions);
  std::unique_ptr<Impl> impl_;
};

/// Reads a file of events, a block at a time.
class EventsReader {
 public:
  /// Reads the description of the run. Errors name file and byte. Of a file without its end, the run ends before the
  /// last instant of the whole blocks, of which a part may be missing, and a remark says so.
  [[nodiscard]] static Result<EventsReader> open(const std::string &path);
  /// The same for bytes in memory, which must outlive the reader; `file` is their name in errors.
  [[nodiscard]] static Result<EventsReader> of(std::string_view bytes, const std::string &file);

  EventsReader(EventsReader &&) noexcept;
  EventsReader &operator=(EventsReader &&) = delete;
  EventsReader(const EventsReader &) = delete;
  EventsReader &operator=(const EventsReader &) = delete;
  ~EventsReader();

  /// With the end of the run. Events that newer ones have replaced count as lost.
  [[nodiscard]] const RunInfo &info() const;
  /// False if the run was killed, or still goes on.
  [[nodiscard]] bool is_complete() const;
  /// How many events the file has.
  [[nodiscard]] std::uint64_t events() const;

  /// Replaces `events` by the next ones. Returns false after the last one. Errors: as open(), and an event that is none
  /// of the run.
  [[nodiscard]] Result<bool> next(std::vector<JobEvent> &events);
  /// Passes all further events to `visit`, some at a time.
  [[nodiscard]] Result<void> visit(const std::function<void(std::span<const JobEvent>)> &visit);
  /// The first events are next again.
  void rewind();

 private:
  class Impl;
  explicit EventsReader(std::unique_ptr<Impl> impl);
  [[nodiscard]] static Result<EventsReader> make(InputFile file);

  std::unique_ptr<Impl> impl_;
};

/// The most events of a trace in memory, at 32 bytes each. EventsReader reads longer files.
inline constexpr std::uint64_t kMostEventsInMemory = std::uint64_t{1} << 28U;

/// Renames a file without its end, which a killed run has left at `path`, to the first free of "events.1.redag" and so
/// on. Returns the new name; empty if there is no such file. Errors: a run that still goes on; what the system refused.
[[nodiscard]] Result<std::string> move_unfinished_aside(const std::string &path);

[[nodiscard]] Result<void> write_trace(const std::string &path, const Trace &trace);

/// Reads a whole trace. Errors: those of EventsReader, more than kMostEventsInMemory events.
[[nodiscard]] Result<Trace> read_trace(const std::string &path);

/// The same for bytes in memory; `file` is their name in errors.
[[nodiscard]] Result<Trace> parse_trace(std::string_view bytes, const std::string &file);

}  // namespace redag::trace
