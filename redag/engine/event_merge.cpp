// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/event_merge.hpp"

#include <algorithm>
#include <tuple>

namespace redag::runtime {
namespace {

bool ends(const JobEvent &event) { return event.kind == JobEventKind::Finished || event.kind == JobEventKind::Aborted; }

bool same_job(const JobEvent &a, const JobEvent &b) { return a.task == b.task && a.job == b.job; }

}  // namespace

void EventMerge::merge(std::vector<JobEvent> &out, bool last) {
  std::sort(started_.begin(), started_.end(), [](const JobEvent &x, const JobEvent &y) {
    return std::tie(x.time, x.task.value, x.job, x.kind) < std::tie(y.time, y.task.value, y.job, y.kind);
  });
  auto next = started_.begin();
  for (const JobEvent &decision : decisions_) {
    for (; next != started_.end() && next->time < decision.time; ++next) append(out, *next);
    // At equal times a decision comes first. Exception: a job's body begins and ends before the job ends.
    while (ends(decision)) {
      const auto of_job = std::find_if(
          next, started_.end(), [&](const JobEvent &e) { return e.time > decision.time || same_job(e, decision); });
      if (of_job == started_.end() || !same_job(*of_job, decision)) break;
      std::rotate(next, of_job, of_job + 1);
      append(out, *next++);
    }
    append(out, decision);
  }
  decisions_.clear();
  if (last) {
    for (; next != started_.end(); ++next) append(out, *next);
  }
  started_.erase(started_.begin(), next);
}

void EventMerge::append(std::vector<JobEvent> &out, JobEvent event) {
  latest_ = std::max(latest_, event.time);
  event.time = latest_;
  out.push_back(event);
}

}  // namespace redag::runtime
