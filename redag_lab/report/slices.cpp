// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/slices.hpp"

#include <algorithm>

namespace redag::report {

void SliceFolder::add(std::span<const JobEvent> events) {
  const std::vector<Device> &devices = run_.workload.platform.devices;
  for (const JobEvent &event : events) {
    last_ = std::max(last_, event.time);
    if (event.task.value >= tasks_) continue;
    const bool is_at_device = event.value >= 0 && static_cast<std::size_t>(event.value) < devices.size();
    const DeviceId device = is_at_device ? DeviceId(static_cast<std::size_t>(event.value)) : DeviceId();
    switch (event.kind) {
      case JobEventKind::Dispatched:
      case JobEventKind::Started:
      case JobEventKind::Resumed: begin(event); break;
      case JobEventKind::Waits: end(event, event.time, Slice::End::Waits); break;
      case JobEventKind::Preempted: end(event, event.time, Slice::End::Preempted); break;
      case JobEventKind::Finished: end(event, event.value, Slice::End::Finished); break;
      case JobEventKind::Aborted: end(event, event.time, Slice::End::Aborted); break;
      case JobEventKind::Served:
        if (is_at_device) begin(event, device);
        break;
      case JobEventKind::Woken:
        if (is_at_device) end(event, event.time, Slice::End::Served, device);
        break;
      default: break;
    }
  }
}

void SliceFolder::finish() {
  last_ = std::max(last_, run_.end);
  for (auto &[key, slice] : open_) {
    slice.end = last_;
    ended_.push_back(slice);
  }
  open_.clear();
}

void SliceFolder::begin(const JobEvent &event, DeviceId device) {
  const auto [open, is_new] = open_.try_emplace({event.task, event.job, device});
  if (!is_new) return;  // Dispatched is followed by Started: the decision and the body form one slice
  open->second = {.begin = event.time,
                  .end = event.time,
                  .task = event.task,
                  .job = event.job,
                  .device = device,
                  .worker = device.valid() ? 0 : event.worker};
}

void SliceFolder::end(const JobEvent &event, Time time, Slice::End how, DeviceId device) {
  const auto found = open_.find({event.task, event.job, device});
  if (found == open_.end()) return;
  Slice &slice = found->second;
  slice.end = std::max(slice.begin, time);
  slice.how = how;
  ended_.push_back(slice);
  open_.erase(found);
}

}  // namespace redag::report
