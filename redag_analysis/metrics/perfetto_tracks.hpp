// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tracks on which slices nest whatever a damaged trace says: one with a single slice at a time, a set of them for jobs
// that overlap, and counters that are written once an instant. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "redag/base/time.hpp"
#include "redag_analysis/metrics/perfetto_packets.hpp"

namespace redag::metrics::perfetto {

/// A track with at most one open slice. Times that would overlap the slice before are moved to its end.
class SliceTrack {
 public:
  explicit SliceTrack(Track track) : track_(track) {}

  [[nodiscard]] Track track() const { return track_; }
  [[nodiscard]] bool is_open() const { return open_; }
  /// True if a slice can begin at `time` as it is.
  [[nodiscard]] bool is_free_at(Time time) const { return !open_ && time >= last_; }

  /// Returns the time to write.
  Time begin(Time time);
  Time end(Time time);

 private:
  Track track_;
  Time last_ = 0;
  bool open_ = false;
};

/// The jobs of a task: as many tracks as overlap at a time, all of one name, which Perfetto draws as one.
class Lanes {
 public:
  Lanes(PacketWriter &writer, std::string name, Track parent);

  /// Returns a lane where a slice can begin at `time`.
  [[nodiscard]] std::size_t free_lane(Time time);
  [[nodiscard]] SliceTrack &operator[](std::size_t lane) { return lanes_[lane]; }

 private:
  PacketWriter &writer_;
  std::string name_;
  Track parent_;
  std::vector<SliceTrack> lanes_;
};

/// Numbers that change with the events. Of several changes at one time, only the last value is written,
/// and only if it is another one.
class Counters {
 public:
  explicit Counters(PacketWriter &writer) : writer_(writer) {}

  std::size_t add(Track track);
  /// Times of calls must not decrease.
  void change(std::size_t counter, std::int64_t by, Time time);
  /// Writes what changed before `time`.
  void advance(Time time);

 private:
  struct Counter {
    Track track = Track::None;
    std::int64_t value = 0;
    std::int64_t written = 0;
    bool changed = false;
  };

  PacketWriter &writer_;
  std::vector<Counter> counters_;
  std::vector<std::size_t> changed_;
  Time time_ = 0;  // of the changes
};

}  // namespace redag::metrics::perfetto
