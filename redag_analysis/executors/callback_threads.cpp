// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/callback_threads.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::executors {

CallbackThreads::CallbackThreads(const sched::Config &config, TimerReleases timer_releases)
    : Lifecycle(config, timer_releases), working_(config.workers, false) {
  REDAG_CHECK(config.workers > 0, "an executor has at least one thread");
  REDAG_CHECK(config.preemption == sched::Preemption::None, "rclcpp's executors do not preempt");
}

void CallbackThreads::preemption_point(JobSlot /*job*/, Time /*now*/) {
  REDAG_CHECK(false, "preemption points are for cooperative preemption");
}

sched::Step CallbackThreads::dispatch(Time now, std::uint32_t most) {
  begin(now);
  before_taking();
  for (; most > 0; --most) {
    const auto free = std::find(working_.begin(), working_.end(), false);
    if (free == working_.end()) break;
    const std::uint32_t slot = take();
    if (slot == sched::kNil) break;
    *free = true;
    start(slot, WorkerId(static_cast<std::uint32_t>(free - working_.begin())), sched::kNil, 0);
  }
  return step();
}

void CallbackThreads::on_end(std::uint32_t slot) {
  working_[jobs_[slot].worker.value] = false;
  on_over(slot);
}

}  // namespace redag::executors
