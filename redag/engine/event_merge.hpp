// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Merges several rings into one stream: the scheduler's decisions in their order, and the workers' events (Started and
// Executed) by time. Relies on the engine's order for each job: Dispatched, Started, Executed, Finished. Owns no ring.
// For one thread at a time.
#pragma once

#include <vector>

#include "redag/model/job_event.hpp"

namespace redag::runtime {

class EventMerge {
 public:
  /// Buffers for the next batch. Drain the decisions first and the workers' rings after them. Then, for every Finished
  /// among the decisions, the workers' events are here or came with an earlier batch.
  [[nodiscard]] std::vector<JobEvent> &decisions() { return decisions_; }
  [[nodiscard]] std::vector<JobEvent> &started() { return started_; }

  /// Appends the events whose place is certain to `out`. Unless `last`, keeps back workers' events that later decisions
  /// may have to precede. Times do not decrease: a late Started gets the time of its neighbour, and its `value` stays
  /// exact.
  void merge(std::vector<JobEvent> &out, bool last);

 private:
  void append(std::vector<JobEvent> &out, JobEvent event);

  std::vector<JobEvent> decisions_;
  std::vector<JobEvent> started_;
  Time latest_ = 0;
};

}  // namespace redag::runtime
