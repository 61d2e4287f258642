// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rule of the trace checker for jobs that wait without a worker (docs/model.md, "Waits"): they wait where their
// tasks do and as long as they do, and devices serve them in order. Internal to metrics/.
#pragma once

#include <cstdint>
#include <vector>

#include "redag_analysis/metrics/check/check_context.hpp"

namespace redag::metrics {

class DeviceRules {
 public:
  explicit DeviceRules(CheckContext &context)
      : context_(context), devices_(context.info.workload.platform.devices.size()) {}

  void before(const JobEvent &event);
  /// Called before time moves on.
  void end_of_instant();
  void end_of_trace();

 private:
  struct Waiting {
    Replay::JobRef job;
    Time since = 0;
    std::size_t wait = 0;  // its place in Task::waits
  };
  struct DeviceState {
    std::vector<Waiting> queue;  // in the order of the requests
    std::uint32_t used = 0;      // slots
  };

  void waits(const JobEvent &event, const LiveJob &job);
  void served(const JobEvent &event, const LiveJob &job);
  void woken(const JobEvent &event, const LiveJob &job);
  void ended(const JobEvent &event, const LiveJob &job);
  [[nodiscard]] DeviceState *device_of(std::int64_t index);
  [[nodiscard]] const Device &device_at(std::int64_t index) const {
    return context_.info.workload.platform.devices[static_cast<std::size_t>(index)];
  }
  [[nodiscard]] bool is_simulated() const { return context_.info.driver == trace::Driver::Simulator; }

  CheckContext &context_;
  std::vector<DeviceState> devices_;
  std::vector<Waiting> away_;  // served, or waiting without a device
  bool changed_ = false;       // since time moved on
};

}  // namespace redag::metrics
