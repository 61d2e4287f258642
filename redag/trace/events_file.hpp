// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files of events (events.redag), the lossless form of a trace: blocks of compressed bytes, each with a checksum. The
// first block describes the run. The last one proves that none is missing; it has a fixed length, and a reader finds it
// from the end. Neither side holds more than one block of events. See docs/results_format.md. Not thread-safe.
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

/// The name of the file in a folder of results.
inline constexpr std::string_view kEventsFile = "events.redag";

/// Writes events as they arrive, for runs that are too long to be kept in memory.
class EventsWriter {
 public:
  /// `info.end` and `info.lost_events` may still be unknown. Errors: an invalid workload, an unwritable place.
  [[nodiscard]] static Result<EventsWriter> create(const std::string &path, const RunInfo &info);

  EventsWriter(EventsWriter &&) noexcept;
  EventsWriter &operator=(EventsWriter &&) = delete;
  EventsWriter(const EventsWriter &) = delete;
  EventsWriter &operator=(const EventsWriter &) = delete;
  ~EventsWriter();

  /// Requires events of the run that `info` described.
  void add(std::span<const JobEvent> events);

  /// Completes the file. Until then it does not exist.
  [[nodiscard]] Result<void> commit(Time end, std::uint64_t lost_events);

 private:
  class Impl;
  explicit EventsWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Reads a file of events, a block at a time.
class EventsReader {
 public:
  /// Reads the description of the run. Errors name file and byte. A file without its end (an
  /// incomplete copy) is an error.
  [[nodiscard]] static Result<EventsReader> open(const std::string &path);
  /// The same for bytes in memory, which must outlive the reader; `file` is their name in errors.
  [[nodiscard]] static Result<EventsReader> of(std::string_view bytes, const std::string &file);

  EventsReader(EventsReader &&) noexcept;
  EventsReader &operator=(EventsReader &&) = delete;
  EventsReader(const EventsReader &) = delete;
  EventsReader &operator=(const EventsReader &) = delete;
  ~EventsReader();

  /// Complete, with the end of the run.
  [[nodiscard]] const RunInfo &info() const;
  /// How many events the file says it has.
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

[[nodiscard]] Result<void> write_trace(const std::string &path, const Trace &trace);

/// Reads a whole trace. Errors: those of EventsReader, more than kMostEventsInMemory events.
[[nodiscard]] Result<Trace> read_trace(const std::string &path);

/// The same for bytes in memory; `file` is their name in errors.
[[nodiscard]] Result<Trace> parse_trace(std::string_view bytes, const std::string &file);

}  // namespace redag::trace
