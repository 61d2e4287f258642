// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/slices.hpp"

#include <algorithm>

namespace redag::report {

void SliceFolder::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) {
    last_ = std::max(last_, event.time);
    if (event.task.value >= open_.size()) continue;
    switch (event.kind) {
      case JobEventKind::Dispatched:
      case JobEventKind::Started:
      case JobEventKind::Resumed: begin(event); break;
      case JobEventKind::Waits: end(event, event.time, Slice::End::Waits); break;
      case JobEventKind::Preempted: end(event, event.time, Slice::End::Preempted); break;
      case JobEventKind::Finished: end(event, event.value, Slice::End::Finished); break;
      case JobEventKind::Aborted: end(event, event.time, Slice::End::Aborted); break;
      default: break;
    }
  }
}

void SliceFolder::finish() {
  last_ = std::max(last_, run_.end);
  for (std::vector<Slice> &task : open_) {
    for (Slice slice : task) {
      slice.end = last_;
      ended_.push_back(slice);
    }
    task.clear();
  }
}

void SliceFolder::begin(const JobEvent &event) {
  std::vector<Slice> &task = open_[event.task.value];
  const auto same = [&](const Slice &slice) { return slice.job == event.job; };
  // Dispatched is followed by Started; the decision and the body form one slice.
  if (std::any_of(task.begin(), task.end(), same)) return;
  task.push_back(Slice{event.time, event.time, event.task, event.job, event.worker, Slice::End::Open});
}

void SliceFolder::end(const JobEvent &event, Time time, Slice::End how) {
  std::vector<Slice> &task = open_[event.task.value];
  const auto slice = std::find_if(task.begin(), task.end(), [&](const Slice &s) { return s.job == event.job; });
  if (slice == task.end()) return;
  slice->end = std::max(slice->begin, time);
  slice->how = how;
  ended_.push_back(*slice);
  task.erase(slice);
}

}  // namespace redag::report
