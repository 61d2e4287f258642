// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds the task of a workload for each ROS 2 callback: compares the file's patterns with the callbacks found at run
// time, and explains mismatches. For set-up, not for the hot path. Not thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag {

/// An existing callback. All names are fully qualified and hold no patterns.
struct CallbackId {
  Callback::Kind kind = Callback::Kind::Timer;
  std::string node;
  std::string name;     // of the topic, service or action; empty for timers and waitables, not for a waitable's timer
  Duration period = 0;  // of a timer
  std::uint32_t index = 0;  // n-th timer (waitable) of its node by creation, from 0

  friend bool operator==(const CallbackId &, const CallbackId &) = default;
};

/// Returns true if `pattern` describes all of `text`. "*" stands for any run of characters (also none, also with "/"),
/// "?" for any one. There is no escape, because no ROS name contains either. O(pattern * text) at worst, O(text) with
/// one "*"; no allocation.
[[nodiscard]] bool glob_match(std::string_view pattern, std::string_view text);

/// Says why `pattern` cannot stand for a fully qualified ROS name, to follow that name in a message ("does not begin
/// with '/'"). Empty if it can.
[[nodiscard]] std::string ros_name_mistake(std::string_view pattern);

[[nodiscard]] bool matches(const Callback &pattern, const CallbackId &id);

/// For example "/ekf subscription /imu/data", "/imu_driver timer 2 ms (0)", "/camera waitable (1)".
[[nodiscard]] std::string to_string(const CallbackId &id);

/// The same for a pattern: "/lidar_* timer", "/imu_driver timer 2 ms", "/imu_driver timer (0)".
[[nodiscard]] std::string to_string(const Callback &pattern);

/// Returns true if ROS itself creates this callback in every such node: parameters, clock, log levels, life cycle. Also
/// for the timer of a waitable, which ROS creates to expire the goals of an action server.
[[nodiscard]] bool is_ros_internal(const CallbackId &id);

/// Assigns tasks to callbacks, and keeps account of both sides. The workload must outlive it and stay unchanged.
class CallbackMatcher {
 public:
  explicit CallbackMatcher(const Workload &workload);

  /// Returns the task that runs this callback, if the file names one. A task whose node has no wildcard wins over one
  /// whose node has, then the first in the file wins. One task can be found for several callbacks.
  [[nodiscard]] std::optional<TaskRef> find(const CallbackId &id);

  /// Returns a line for every task whose callback was not found yet, in the order of the file. It says what the task
  /// names, and which of the callbacks seen is nearest to it.
  [[nodiscard]] std::vector<std::string> unmatched() const;

 private:
  struct Seen {
    CallbackId id;
    std::optional<std::uint32_t> entry;  // index in entries_
  };
  struct Entry {
    TaskRef task;
    std::string name;  // "dag.task"
    bool matched = false;
  };

  [[nodiscard]] std::optional<std::uint32_t> entry_of(const CallbackId &id) const;
  [[nodiscard]] std::string explain(const Entry &entry) const;

  std::vector<Entry> entries_;                                                // tasks with a callback
  std::unordered_map<std::string_view, std::vector<std::uint32_t>> by_node_;  // entries without a wildcard in the node
  std::vector<std::uint32_t> patterns_;                                       // the other entries
  std::vector<Seen> seen_;
  std::unordered_set<std::string> seen_texts_;
};

}  // namespace redag
