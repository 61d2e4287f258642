// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/exploration/exploration_states.hpp"

#include <algorithm>

#include "redag/base/rng.hpp"

namespace redag::analysis {

StateSet::StateSet(std::size_t tasks, std::size_t width, std::size_t workers)
    : tasks_(tasks), width_(width), workers_(workers), table_(16, kNone), scratch_(width) {}

std::uint32_t StateSet::find(std::span<const std::uint32_t> counts, std::uint64_t hash, std::size_t &place) const {
  const std::size_t mask = table_.size() - 1;
  for (place = mix(hash) & mask; table_[place] != kNone; place = (place + 1) & mask) {
    const std::uint32_t node = table_[place];
    if (nodes_[node].hash == hash &&
        std::equal(counts.begin(), counts.end(), counts_.begin() + static_cast<std::ptrdiff_t>(node * tasks_))) {
      return node;
    }
  }
  return kNone;
}

std::uint32_t StateSet::find_or_add(std::span<const std::uint32_t> counts, std::uint64_t hash) {
  std::size_t place = 0;
  const std::uint32_t found = find(counts, hash, place);
  if (found != kNone) return found;
  const auto node = size();
  table_[place] = node;
  nodes_.push_back(Node{hash, kNone});
  counts_.insert(counts_.end(), counts.begin(), counts.end());
  if (2 * nodes_.size() > table_.size()) grow();
  return node;
}

void StateSet::grow() {
  table_.assign(2 * table_.size(), kNone);
  const std::size_t mask = table_.size() - 1;
  for (std::uint32_t node = 0; node < size(); ++node) {
    std::size_t place = mix(nodes_[node].hash) & mask;
    while (table_[place] != kNone) place = (place + 1) & mask;
    table_[place] = node;
  }
}

// Times are integers: [1, 2] and [3, 4] leave no gap.
bool StateSet::touches(const Interval *a, const Interval *b) const {
  for (std::size_t w = 0; w < workers_; ++w) {
    if (a[w].earliest > b[w].latest + 1 || b[w].earliest > a[w].latest + 1) return false;
  }
  return true;
}

bool StateSet::add(std::uint32_t node, std::span<const Interval> state) {
  std::copy(state.begin(), state.end(), scratch_.begin());
  bool is_new = true;
  for (std::uint32_t *link = &nodes_[node].first; *link != kNone;) {
    const std::uint32_t other = *link;
    Interval *row = rows_.data() + other * width_;
    if (!touches(row, scratch_.data())) {
      link = &next_[other];
      continue;
    }
    bool is_within = true;
    for (std::size_t i = 0; i < width_; ++i) {
      is_within = is_within && row[i].earliest <= scratch_[i].earliest && scratch_[i].latest <= row[i].latest;
      scratch_[i].earliest = std::min(scratch_[i].earliest, row[i].earliest);
      scratch_[i].latest = std::max(scratch_[i].latest, row[i].latest);
    }
    if (is_within) return false;
    // The union may touch states that neither part touched; all are compared again.
    *link = next_[other];
    next_[other] = unused_;
    unused_ = other;
    is_new = false;
    link = &nodes_[node].first;
  }
  keep(node, scratch_);
  return is_new;
}

void StateSet::keep(std::uint32_t node, std::span<const Interval> state) {
  std::uint32_t place = unused_;
  if (place == kNone) {
    place = static_cast<std::uint32_t>(next_.size());
    next_.push_back(kNone);
    rows_.resize(rows_.size() + width_);
  } else {
    unused_ = next_[place];
  }
  std::copy(state.begin(), state.end(), rows_.begin() + static_cast<std::ptrdiff_t>(place * width_));
  next_[place] = nodes_[node].first;
  nodes_[node].first = place;
}

bool StateSet::covers(std::span<const std::uint32_t> counts, std::uint64_t hash,
                      std::span<const Interval> state) const {
  std::size_t place = 0;
  const std::uint32_t node = find(counts, hash, place);
  if (node == kNone) return false;
  for (std::uint32_t s = nodes_[node].first; s != kNone; s = next_[s]) {
    const Interval *row = rows_.data() + s * width_;
    bool is_within = true;
    for (std::size_t i = 0; i < width_ && is_within; ++i) {
      is_within = row[i].earliest <= state[i].earliest && state[i].latest <= row[i].latest;
    }
    if (is_within) return true;
  }
  return false;
}

bool StateSet::has_states() const {
  return std::any_of(nodes_.begin(), nodes_.end(), [](const Node &node) { return node.first != kNone; });
}

void StateSet::clear() {
  nodes_.clear();
  counts_.clear();
  rows_.clear();
  next_.clear();
  unused_ = kNone;
  std::fill(table_.begin(), table_.end(), kNone);
}

}  // namespace redag::analysis
