// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// events.jsonl, the lossless form of a trace: a line for the run, a line for each event, and a last line that proves
// that no line is missing. See docs/results_format.md. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

/// Writes events as they arrive, for runs that are too long to be kept in memory.
class EventsWriter {
 public:
  /// `info.end` and `info.lost_events` may still be unknown. Errors: an invalid workload, an unwritable place.
  [[nodiscard]] static Result<EventsWriter> create(const std::string &path, const RunInfo &info);

  void add(std::span<const JobEvent> events);

  /// Completes the file. Until then it does not exist.
  [[nodiscard]] Result<void> commit(Time end, std::uint64_t lost_events);

 private:
  explicit EventsWriter(OutputFile file) : file_(std::move(file)) {}

  OutputFile file_;
  std::uint64_t count_ = 0;
};

[[nodiscard]] Result<void> write_trace(const std::string &path, const Trace &trace);

/// Reads a trace. Errors name file and line. A file without its last line (an incomplete copy) is an error.
[[nodiscard]] Result<Trace> read_trace(const std::string &path);

/// The same for text in memory; `file` is its name in errors.
[[nodiscard]] Result<Trace> parse_trace(std::string_view text, const std::string &file);

}  // namespace redag::trace
