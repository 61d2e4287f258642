// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/services.hpp"

#include <algorithm>

namespace redag::report {

std::vector<Service> services_of(const trace::Trace &trace) {
  std::vector<std::vector<Service>> open(trace.info.workload.platform.devices.size());  // by DeviceId
  std::vector<Service> ended;
  Time last = trace.info.end;
  for (const JobEvent &event : trace.events) {
    last = std::max(last, event.time);
    if (event.value < 0 || static_cast<std::size_t>(event.value) >= open.size()) continue;
    if (event.kind != JobEventKind::Served && event.kind != JobEventKind::Woken) continue;
    const DeviceId device(static_cast<std::size_t>(event.value));
    std::vector<Service> &services = open[device.value];
    if (event.kind == JobEventKind::Woken) {
      const auto served = std::find_if(services.begin(), services.end(), [&](const Service &service) {
        return service.task == event.task && service.job == event.job;
      });
      if (served == services.end()) continue;
      served->end = event.time;
      ended.push_back(*served);
      services.erase(served);
      continue;
    }
    std::uint32_t slot = 0;
    const auto is_used = [&](const Service &service) { return service.slot == slot; };
    while (std::any_of(services.begin(), services.end(), is_used)) ++slot;
    services.push_back({event.time, event.time, event.task, event.job, device, slot});
  }
  for (const std::vector<Service> &services : open) {
    for (Service service : services) {
      service.end = last;
      ended.push_back(service);
    }
  }
  std::stable_sort(ended.begin(), ended.end(), [](const Service &a, const Service &b) { return a.begin < b.begin; });
  return ended;
}

}  // namespace redag::report
