// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The two forms of a file of events, behind EventsWriter and EventsReader (events_file.hpp): text, and blocks of
// compressed bytes. Internal to trace/. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/input_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

class EventsSink {
 public:
  virtual ~EventsSink() = default;
  virtual void add(std::span<const JobEvent> events) = 0;
  [[nodiscard]] virtual Result<void> commit(Time end, std::uint64_t lost_events) = 0;
};

/// What the last line, or the last block, says about the whole.
struct EventsFooter {
  std::uint64_t events = 0;
  Time end = 0;
  std::uint64_t lost_events = 0;
};

class EventsSource {
 public:
  virtual ~EventsSource() = default;
  /// As EventsReader::next().
  [[nodiscard]] virtual Result<bool> next(std::vector<JobEvent> &events) = 0;
  /// The first events are next again.
  virtual void rewind() = 0;

  RunInfo info;  // complete
  EventsFooter footer;
};

inline constexpr std::string_view kTextFormat = "redag.events/1";
inline constexpr std::string_view kBlockFormat = "redag.events/2";
/// The first bytes of a file of blocks. The carriage return shows a copy that "corrected" the ends of lines.
inline constexpr std::string_view kBlockMagic = "redag.events/2\r\n";
static_assert(kBlockMagic.size() == 16);

/// Both write the description of the run into `file`.
[[nodiscard]] std::unique_ptr<EventsSink> text_sink(OutputFile file, const RunInfo &info);
[[nodiscard]] std::unique_ptr<EventsSink> block_sink(OutputFile file, const RunInfo &info);

/// Both read the description of the run and the footer. Errors name the file and a line, or a byte.
[[nodiscard]] Result<std::unique_ptr<EventsSource>> text_source(InputFile file);
[[nodiscard]] Result<std::unique_ptr<EventsSource>> block_source(InputFile file);

}  // namespace redag::trace
