// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One stream out of several rings: the scheduler's decisions, in their order, and the workers' events (Started and
// Executed), by time. Pure; one thread. Relies on how the engine pushes: Dispatched before Started before Executed
// before Finished, for each job.
#pragma once

#include <vector>

#include "redag/model/job_event.hpp"

namespace redag::runtime {

class EventMerge {
 public:
  /// Where the next batch goes before merge(): decisions drained first, the workers' rings after them. Then every
  /// Finished among the decisions has its workers' events here, now or from an earlier batch.
  [[nodiscard]] std::vector<JobEvent> &decisions() { return decisions_; }
  [[nodiscard]] std::vector<JobEvent> &started() { return started_; }

  /// Appends to `out` what is sure to be in place; keeps back workers' events that later decisions may have to
  /// precede, unless `last`. Times do not decrease: a Started that comes late gets the time of its neighbour, `value`
  /// stays exact.
  void merge(std::vector<JobEvent> &out, bool last);

 private:
  void append(std::vector<JobEvent> &out, JobEvent event);

  std::vector<JobEvent> decisions_;
  std::vector<JobEvent> started_;
  Time latest_ = 0;
};

}  // namespace redag::runtime
