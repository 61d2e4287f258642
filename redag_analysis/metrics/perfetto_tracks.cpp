// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto_tracks.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics::perfetto {

Time SliceTrack::begin(Time time) {
  last_ = std::max(last_, time);
  open_ = true;
  return last_;
}

Time SliceTrack::end(Time time) {
  last_ = std::max(last_, time);
  open_ = false;
  return last_;
}

Lanes::Lanes(PacketWriter &writer, std::string name, Track parent)
    : writer_(writer), name_(std::move(name)), parent_(parent) {
  lanes_.emplace_back(writer_.add_track(name_, parent_));
}

std::size_t Lanes::free_lane(Time time) {
  const auto free =
      std::find_if(lanes_.begin(), lanes_.end(), [&](const SliceTrack &lane) { return lane.is_free_at(time); });
  if (free != lanes_.end()) return static_cast<std::size_t>(free - lanes_.begin());
  lanes_.emplace_back(writer_.add_track(name_, parent_));
  return lanes_.size() - 1;
}

std::size_t Counters::add(Track track) {
  counters_.push_back({track});
  writer_.count(track, 0, 0);
  return counters_.size() - 1;
}

void Counters::change(std::size_t counter, std::int64_t by, Time time) {
  advance(time);
  Counter &its = counters_[counter];
  its.value += by;
  if (!std::exchange(its.changed, true)) changed_.push_back(counter);
  time_ = time;
}

void Counters::advance(Time time) {
  if (changed_.empty() || time <= time_) return;
  for (const std::size_t i : changed_) {
    Counter &its = counters_[i];
    its.changed = false;
    if (std::exchange(its.written, its.value) != its.value) writer_.count(its.track, time_, its.value);
  }
  changed_.clear();
}

}  // namespace redag::metrics::perfetto
