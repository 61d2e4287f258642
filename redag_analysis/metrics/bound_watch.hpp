// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which responses of a run exceeded what was proven for them. Follows a stream of events, in pieces if need be; knows
// tasks by id alone. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <unordered_map>

#include "redag/model/job_event.hpp"

namespace redag::metrics {

/// What was seen of one task against its bound.
struct BoundCount {
  Duration bound = 0;
  std::uint64_t exceeded = 0;  // responses above it
  Duration worst = 0;          // of these
};

class BoundWatch {
 public:
  /// The bound on a task's response time, from its nominal release; 0: none. Asked once a task.
  using BoundOf = std::function<Duration(TaskId)>;

  /// Called for each response above its bound, with what has been counted of the task so far.
  using Exceeded = std::function<void(TaskId, const BoundCount &)>;

  /// A response is f - r as measured. Jobs released before the first event are not judged.
  void add(std::span<const JobEvent> events, const BoundOf &bound_of, const Exceeded &exceeded = {});

  /// Null for a task of which nothing was seen, or that has no bound.
  [[nodiscard]] const BoundCount *of(TaskId task) const;

 private:
  std::unordered_map<std::uint32_t, BoundCount> tasks_;  // by task id
  std::unordered_map<std::uint64_t, Time> releases_;     // of jobs in flight, by task id and number
};

}  // namespace redag::metrics
