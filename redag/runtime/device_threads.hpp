// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The threads of an engine's devices, one for each slot. A thread calls the function of a job's wait while its device
// serves the job, and then reports the end. The scheduler decides which job is served. Members are guarded by the
// engine's lock, except start() and end(), which are for one thread at a time.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"
#include "redag/runtime/coroutine.hpp"
#include "redag/runtime/parker.hpp"
#include "redag/runtime/threads.hpp"

namespace redag::runtime {

struct DeviceThread {
  DeviceId device;
  Parker parker;
  detail::Wait *wait = nullptr;  // to be served; written before a token is left, while the thread is idle
  ThreadHandle handle;
};

class DeviceThreads {
 public:
  /// Called at the end of each service, on the thread that served. What was served may not be touched afterwards.
  using Served = std::function<void(DeviceThread &thread, JobSlot job)>;

  explicit DeviceThreads(const std::vector<Device> &devices);

  /// Creates the threads, named `name`-DEVICE. Error: what the system refused; call end().
  [[nodiscard]] Result<void> start(const std::string &name, int priority, const Served &served);
  /// Tells the threads to end, and waits for them. None serves a job. start() can be called again.
  void end();

  /// Lets an idle thread of the device serve. The scheduler has found a free slot.
  void serve(detail::Wait &wait);
  /// Returns true if the calling thread is one of them. After start().
  [[nodiscard]] bool is_this_thread() const;
  void add_idle(DeviceThread &thread) { idle_[thread.device.value].push_back(&thread); }

 private:
  void main(DeviceThread &self, const Served &served) noexcept;

  std::vector<Device> devices_;
  std::vector<std::unique_ptr<DeviceThread>> threads_;
  std::vector<std::vector<DeviceThread *>> idle_;  // by DeviceId
  Atomic<bool> ending_{false};
};

}  // namespace redag::runtime
