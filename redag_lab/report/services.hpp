// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which job each device served when. Pure functions.
#pragma once

#include <cstdint>
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

/// Returns services in order of their begin. One in progress at the end ends with the trace.
[[nodiscard]] std::vector<Service> services_of(const trace::Trace &trace);

}  // namespace redag::report
