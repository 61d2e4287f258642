// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The partial schedules that the exploration keeps. Each set of jobs dispatched up to now has a node, and each node has
// the states in which these jobs can leave the platform. Independent of tasks and priorities.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::analysis {

/// From the earliest to the latest instant at which something can happen.
struct Interval {
  Time earliest = 0;
  Time latest = 0;

  friend bool operator==(const Interval &, const Interval &) = default;
};

/// Nodes and their states. A state is a row of intervals of one width. The first `workers` intervals say when one, two,
/// ... workers are free. Not thread-safe.
class StateSet {
 public:
  StateSet(std::size_t tasks, std::size_t width, std::size_t workers);

  /// Returns the node of the dispatched jobs, and adds it if it is missing. `counts` is their number by task. The hash
  /// depends on the counts alone.
  std::uint32_t find_or_add(std::span<const std::uint32_t> counts, std::uint64_t hash);

  /// Adds the state, or widens a state of the node that it touches in every interval of its workers. With one worker a
  /// row is one interval, and nothing is lost. With several, the result can stand for more schedules than its parts
  /// did. Returns false if the state was merged into another.
  bool add(std::uint32_t node, std::span<const Interval> state);

  /// Adds the state unchanged: exactly this state was followed.
  void keep(std::uint32_t node, std::span<const Interval> state);

  /// True if a state of the same node in this set includes the given one.
  [[nodiscard]] bool covers(std::span<const std::uint32_t> counts, std::uint64_t hash,
                            std::span<const Interval> state) const;

  /// Removes the states for which drop(node, state) is true.
  template <class Drop>
  void remove_if(Drop drop) {
    for (std::uint32_t node = 0; node < size(); ++node) {
      std::uint32_t *link = &nodes_[node].first;
      while (*link != kNone) {
        drop(node, state(*link)) ? static_cast<void>(*link = next_[*link]) : static_cast<void>(link = &next_[*link]);
      }
    }
  }

  /// Calls use(state) for each state of the node.
  template <class Use>
  void for_each(std::uint32_t node, Use use) const {
    for (std::uint32_t s = nodes_[node].first; s != kNone; s = next_[s]) use(state(s));
  }

  void clear();

  [[nodiscard]] std::uint32_t size() const { return static_cast<std::uint32_t>(nodes_.size()); }
  [[nodiscard]] bool has_states() const;
  [[nodiscard]] std::uint64_t hash(std::uint32_t node) const { return nodes_[node].hash; }
  [[nodiscard]] std::span<const std::uint32_t> counts(std::uint32_t node) const {
    return {counts_.data() + node * tasks_, tasks_};
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffff;
  struct Node {
    std::uint64_t hash = 0;
    std::uint32_t first = kNone;  // a state
  };

  [[nodiscard]] std::uint32_t find(std::span<const std::uint32_t> counts, std::uint64_t hash, std::size_t &place) const;
  void grow();
  [[nodiscard]] std::span<const Interval> state(std::uint32_t s) const { return {rows_.data() + s * width_, width_}; }
  [[nodiscard]] bool touches(const Interval *a, const Interval *b) const;

  std::size_t tasks_;
  std::size_t width_;
  std::size_t workers_;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> counts_;  // tasks_ values per node
  std::vector<Interval> rows_;         // width_ intervals per state
  std::vector<std::uint32_t> next_;    // the next state of the same node
  std::vector<std::uint32_t> table_;   // nodes, by open addressing on the hash
  std::vector<Interval> scratch_;
  std::uint32_t unused_ = kNone;  // first of the removed states, linked by next_
};

}  // namespace redag::analysis
