// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds the responses of a run that exceeded their proven bound. Takes the stream of events in pieces of any size, and
// knows tasks by id alone. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <unordered_map>

#include "redag/model/job_event.hpp"

namespace redag::metrics {

/// The responses of one task compared with its bound.
struct BoundCount {
  Duration bound = 0;
  std::uint64_t exceeded = 0;  // number of responses above it
  Duration worst = 0;          // the largest of these
};

class BoundWatch {
 public:
  /// The bound on a task's response time, from its nominal release; 0: no bound. Called once per task.
  using BoundOf = std::function<Duration(TaskId)>;

  /// Called for each response above its bound, with the counts of the task up to then.
  using Exceeded = std::function<void(TaskId, const BoundCount &)>;

  /// Adds events. A response is f - r as measured. Jobs released before the first event are not judged.
  void add(std::span<const JobEvent> events, const BoundOf &bound_of, const Exceeded &exceeded = {});

  /// Returns null for a task without a bound, or of which no job was seen.
  [[nodiscard]] const BoundCount *of(TaskId task) const;

 private:
  std::unordered_map<std::uint32_t, BoundCount> tasks_;  // by task id
  std::unordered_map<std::uint64_t, Time> releases_;     // of jobs in flight, by task id and number
};

}  // namespace redag::metrics
