// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What exploration.hpp keeps of the schedules that it has not followed to their end: for each set of jobs dispatched so
// far a node, for each node the states in which that can leave the platform. Knows nothing of tasks or priorities.
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

/// Nodes and their states. A state is a row of intervals of one width, the first `workers` of which say when one, two,
/// ... workers are free. Not thread-safe.
class StateSet {
 public:
  StateSet(std::size_t tasks, std::size_t width, std::size_t workers);

  /// The node of the jobs dispatched (`counts`: how many of each task), added where there is none. The hash depends on
  /// the counts alone.
  std::uint32_t find_or_add(std::span<const std::uint32_t> counts, std::uint64_t hash);

  /// Adds the state, or widens one of the node's that it touches in every interval of its workers. With one worker a
  /// row is one interval and nothing is lost by that; with more, what results can stand for more than its parts did.
  /// False: it went up in another.
  bool add(std::uint32_t node, std::span<const Interval> state);

  /// Adds the state as it is: what it covers was really followed.
  void keep(std::uint32_t node, std::span<const Interval> state);

  /// Does a state of the same node, of the other set, include this one?
  [[nodiscard]] bool covers(std::span<const std::uint32_t> counts, std::uint64_t hash,
                            std::span<const Interval> state) const;

  /// Takes away the states for which drop(node, state) is true.
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
    std::uint32_t first = kNone;  // state
  };

  [[nodiscard]] std::uint32_t find(std::span<const std::uint32_t> counts, std::uint64_t hash, std::size_t &place) const;
  void grow();
  [[nodiscard]] std::span<const Interval> state(std::uint32_t s) const { return {rows_.data() + s * width_, width_}; }
  [[nodiscard]] bool touches(const Interval *a, const Interval *b) const;

  std::size_t tasks_;
  std::size_t width_;
  std::size_t workers_;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> counts_;  // tasks_ a node
  std::vector<Interval> rows_;         // width_ a state
  std::vector<std::uint32_t> next_;    // state of the same node
  std::vector<std::uint32_t> table_;   // open addressing by hash: nodes
  std::vector<Interval> scratch_;
  std::uint32_t unused_ = kNone;  // states taken away, by next_
};

}  // namespace redag::analysis
