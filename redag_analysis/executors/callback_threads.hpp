// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the models of rclcpp's executors share: threads that run one callback after the other, each to its end, without
// priorities or budgets. The model decides which callback is next. Not thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/sched/job_table.hpp"

namespace redag::executors {

class CallbackThreads {
 public:
  /// Requires config.workers > 0 and Preemption::None.
  explicit CallbackThreads(sched::JobTable &table) : table_(table), working_(table.config.workers, false) {
    REDAG_CHECK(!working_.empty(), "an executor has at least one thread");
    REDAG_CHECK(table.config.preemption == sched::Preemption::None, "rclcpp's executors do not preempt");
  }

  /// Gives each free thread the job that `take()` returns, until that is kNil. Starts at most `most` jobs.
  template <class Take>
  void run(std::uint32_t most, Take take) {
    for (; most > 0; --most) {
      const auto free = std::find(working_.begin(), working_.end(), false);
      if (free == working_.end()) return;
      const std::uint32_t slot = take();
      if (slot == sched::kNil) return;
      *free = true;
      table_.start(slot, WorkerId(static_cast<std::uint32_t>(free - working_.begin())), sched::kNil, 0);
    }
  }

  /// The thread of a job that ended is free.
  void on_end(std::uint32_t slot) { working_[table_.jobs[slot].worker.value] = false; }

 private:
  sched::JobTable &table_;
  std::vector<bool> working_;  // by thread
};

}  // namespace redag::executors
