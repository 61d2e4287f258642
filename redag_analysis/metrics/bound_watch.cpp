// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/bound_watch.hpp"

#include <algorithm>

namespace redag::metrics {
namespace {

std::uint64_t key_of(const JobEvent &event) { return std::uint64_t{event.task.value} << 32U | event.job; }

}  // namespace

void BoundWatch::add(std::span<const JobEvent> events, const BoundOf &bound_of, const Exceeded &exceeded) {
  for (const JobEvent &event : events) {
    auto task = tasks_.find(event.task.value);
    if (task == tasks_.end()) task = tasks_.emplace(event.task.value, BoundCount{bound_of(event.task), 0, 0}).first;
    BoundCount &count = task->second;
    if (count.bound == 0) continue;
    switch (event.kind) {
      case JobEventKind::Released: releases_[key_of(event)] = event.value; break;
      case JobEventKind::Skipped:
      case JobEventKind::Aborted: releases_.erase(key_of(event)); break;
      case JobEventKind::Finished: {
        const auto release = releases_.find(key_of(event));
        if (release == releases_.end()) break;
        const Duration response = event.value - release->second;
        releases_.erase(release);
        if (response <= count.bound) break;
        ++count.exceeded;
        count.worst = std::max(count.worst, response);
        if (exceeded) exceeded(event.task, count);
        break;
      }
      default: break;
    }
  }
}

const BoundCount *BoundWatch::of(TaskId task) const {
  const auto found = tasks_.find(task.value);
  return found == tasks_.end() || found->second.bound == 0 ? nullptr : &found->second;
}

}  // namespace redag::metrics
