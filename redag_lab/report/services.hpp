// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Folds the events of a run into services: which job each device served when. Incremental, as JobFolder is. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "redag/trace/trace.hpp"

namespace redag::report {

/// A job at a device, from when it is served until it is woken.
struct Service {
  Time begin = 0;
  Time end = 0;
  TaskId task;
  std::uint32_t job = 0;
  DeviceId device;
  std::uint32_t slot = 0;  // the first that was free

  friend bool operator==(const Service &, const Service &) = default;
};

class ServiceFolder {
 public:
  /// `run` must outlive this object.
  explicit ServiceFolder(const trace::RunInfo &run) : run_(run), open_(run.workload.platform.devices.size()) {}

  /// Continues from the last call.
  void add(std::span<const JobEvent> events);
  /// Ends the services in progress at the last event, or at the end of the run if that is later.
  void finish();

  /// Passes the services that ended since the last call to visit(const Service &), in order of their end.
  template <class Visit>
  void drain(Visit &&visit) {
    for (const Service &service : ended_) visit(service);
    ended_.clear();
  }

 private:
  void add(const JobEvent &event);

  const trace::RunInfo &run_;
  std::vector<std::vector<Service>> open_;  // by DeviceId
  std::vector<Service> ended_;
  Time last_ = 0;  // event
};

}  // namespace redag::report
