// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/device_handle.hpp"

#include <stdexcept>

#include "redag/engine/running_job.hpp"

namespace redag::runtime {

void DeviceHandle::check() const {
  const RunningJob *const running = RunningJob::current();
  if (running != nullptr && running->engine == engine_) return;
  throw std::logic_error(
      "DeviceHandle::run(): the device is of another executor (use a handle from device() of the executor that runs "
      "the body)");
}

}  // namespace redag::runtime
