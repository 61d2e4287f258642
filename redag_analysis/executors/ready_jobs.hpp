// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The ready jobs of one task, oldest first: a list through Job::task_next. Models of rclcpp's executors have one for
// each timer and subscription.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/sched/job.hpp"

namespace redag::executors {

struct ReadyJobs {
  std::uint32_t first = sched::kNil;
  std::uint32_t last = sched::kNil;

  [[nodiscard]] bool empty() const { return first == sched::kNil; }

  void push(std::vector<sched::Job> &jobs, std::uint32_t slot) {
    jobs[slot].task_next = sched::kNil;
    (last == sched::kNil ? first : jobs[last].task_next) = slot;
    last = slot;
  }

  /// Removes and returns the oldest job. Requires !empty().
  std::uint32_t pop(std::vector<sched::Job> &jobs) {
    const std::uint32_t slot = first;
    remove(jobs, slot);
    return slot;
  }

  void remove(std::vector<sched::Job> &jobs, std::uint32_t slot) {
    std::uint32_t before = sched::kNil;
    for (std::uint32_t s = first; s != slot; s = jobs[s].task_next) before = s;
    (before == sched::kNil ? first : jobs[before].task_next) = jobs[slot].task_next;
    if (last == slot) last = before;
  }
};

}  // namespace redag::executors
