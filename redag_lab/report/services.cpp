// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/services.hpp"

#include <algorithm>

namespace redag::report {

void ServiceFolder::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) {
    last_ = std::max(last_, event.time);
    if (event.value < 0 || static_cast<std::size_t>(event.value) >= open_.size()) continue;
    if (event.kind == JobEventKind::Served || event.kind == JobEventKind::Woken) add(event);
  }
}

void ServiceFolder::add(const JobEvent &event) {
  const DeviceId device(static_cast<std::size_t>(event.value));
  std::vector<Service> &services = open_[device.value];
  if (event.kind == JobEventKind::Woken) {
    const auto served = std::find_if(services.begin(), services.end(), [&](const Service &service) {
      return service.task == event.task && service.job == event.job;
    });
    if (served == services.end()) return;
    served->end = event.time;
    ended_.push_back(*served);
    services.erase(served);
    return;
  }
  std::uint32_t slot = 0;
  const auto is_used = [&](const Service &service) { return service.slot == slot; };
  while (std::any_of(services.begin(), services.end(), is_used)) ++slot;
  services.push_back({event.time, event.time, event.task, event.job, device, slot});
}

void ServiceFolder::finish() {
  last_ = std::max(last_, run_.end);
  for (std::vector<Service> &services : open_) {
    for (Service service : services) {
      service.end = last_;
      ended_.push_back(service);
    }
    services.clear();
  }
}

}  // namespace redag::report
