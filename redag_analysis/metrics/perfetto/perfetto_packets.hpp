// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes packets of Perfetto's trace format: tracks, slices, instants and counters. Owns the file, and compresses
// packets in blocks, which Perfetto reads as they are. Knows nothing of jobs. Memory does not grow with the file. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::metrics::perfetto {

/// A track with at most one open slice. Slices nest whatever a damaged trace says: times that would overlap the slice
/// before are moved to its end.
struct Track {
  std::uint64_t id = 0;  // 0: none
  Time last = 0;         // of its slices
  bool is_open = false;

  /// True if a slice can begin at `time` as it is.
  [[nodiscard]] bool is_free_at(Time time) const { return !is_open && time >= last; }
};

/// What a slice or an instant states besides its name.
struct Argument {
  std::string_view name;
  std::variant<std::int64_t, std::string_view> value;
};

/// Arrows between slices. A number begins and ends one arrow of the file.
using Flows = std::span<const std::uint64_t>;

class PacketWriter {
 public:
  explicit PacketWriter(trace::OutputFile file);

  /// Adds a track, below `parent` unless that is 0. Siblings have the order in which they are added; those of one name
  /// are drawn as one.
  [[nodiscard]] Track add_track(std::string_view name, std::uint64_t parent = 0);
  /// The same of a number that changes, which is 0 first. Returns its id.
  [[nodiscard]] std::uint64_t add_counter(std::string_view name, std::uint64_t parent);

  // Times count from the beginning of the trace; earlier ones become 0.
  void begin(Track &track, Time time, std::string_view name, std::string_view category,
             std::span<const Argument> arguments, Flows arriving = {});
  void end(Track &track, Time time, std::span<const Argument> arguments = {}, Flows leaving = {});
  void instant(const Track &track, Time time, std::string_view name, std::span<const Argument> arguments);
  void count(std::uint64_t counter, Time time, std::int64_t value);

  /// Completes the file.
  [[nodiscard]] Result<void> commit();

 private:
  std::uint64_t add_track(std::string_view name, std::uint64_t parent, bool is_counter);
  template <class Fill>
  void event(std::uint64_t track, Time time, std::uint64_t type, Fill fill);
  void flush();

  trace::OutputFile file_;
  std::string raw_;         // packets that are not compressed yet
  std::string compressed_;  // reused
  std::uint64_t tracks_ = 0;
};

}  // namespace redag::metrics::perfetto
