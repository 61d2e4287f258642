// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/fast_rta.hpp"

#include <algorithm>
#include <array>
#include <vector>

#include "redag/base/check.hpp"
#include "redag_analysis/core/arithmetic.hpp"

namespace redag::analysis {
namespace {

constexpr Duration kLongest = Duration{1} << 50;

// For each more urgent task, the instant up to which its jobs are counted: the next one is released then. The windows
// only grow from task to task, so that counts are carried over and hardly anything is divided.
bool examine(std::span<const SimpleTask> tasks, Duration *counted_until) {
  Duration load = 0;       // of the jobs counted
  Duration window = 0;     // response time of the task before
  Duration next = kNever;  // least of counted_until
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    const SimpleTask &task = tasks[i];
    // R_i >= R_{i-1} + C_i: M. Sjoedin, H. Hansson, RTSS 1998.
    window += task.wcet;
    while (window > next) {
      next = kNever;
      for (std::size_t j = 0; j < i; ++j) {
        Duration until = counted_until[j];
        if (until < window) {
          // Nearly always one job more; a division only where it is many.
          const Duration jobs = window - until <= tasks[j].period ? 1 : ceil_div(window - until, tasks[j].period);
          until += jobs * tasks[j].period;
          load += jobs * tasks[j].wcet;
        }
        counted_until[j] = until;
        next = std::min(next, until);
      }
      window = load + task.wcet;
      if (window > task.deadline) return false;
    }
    if (window > task.deadline) return false;
    load += task.wcet;
    counted_until[i] = task.period;
    next = std::min(next, task.period);
  }
  return true;
}

}  // namespace

bool is_schedulable(std::span<const SimpleTask> tasks) {
  for (const SimpleTask &task : tasks) {
    REDAG_CHECK(task.wcet > 0 && task.deadline > 0 && task.deadline <= task.period && task.period < kLongest,
                "a task outside what the exact test is for");
    if (task.wcet > task.deadline) return false;  // and so no load below overflows
  }
  constexpr std::size_t kFew = 64;
  if (tasks.size() <= kFew) {
    std::array<Duration, kFew> counted_until;  // written before it is read
    return examine(tasks, counted_until.data());
  }
  std::vector<Duration> counted_until(tasks.size());
  return examine(tasks, counted_until.data());
}

}  // namespace redag::analysis
