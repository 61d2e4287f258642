// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The threads of an engine's devices, one for each slot. A thread calls the function of a job's wait while its device
// serves the job, and then reports the end. The scheduler decides which job is served. Members are guarded by the
// engine's lock, except start() and end(), which are for one thread at a time.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "redag/base/atomic.hpp"
#include "redag/base/result.hpp"
#include "redag/engine/coroutine.hpp"
#include "redag/model/workload.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"

namespace redag::runtime {

/// The figures of one device for a live view.
struct DeviceFigures {
  Device device;
  std::uint32_t queued = 0;    // jobs that asked it and are not served yet
  std::uint64_t served = 0;    // services that have ended
  Duration busy = 0;           // time of all its services, in progress or ended
  std::vector<TaskId> serves;  // the tasks of the jobs that it serves now
};

struct DeviceThread {
  DeviceId device;
  TaskId task;       // of the job that it serves; not valid: it is idle
  Time since = 0;    // when this service began
  int priority = 0;  // of the service
  Parker parker;
  detail::Wait *wait = nullptr;  // to be served; written before a token is left, while the thread is idle
  ThreadHandle handle;
};

class DeviceThreads {
 public:
  /// Called at the end of each service, on the thread that served. What was served may not be touched afterwards.
  using Served = std::function<void(DeviceThread &thread, JobSlot job)>;

  explicit DeviceThreads(std::span<const Device> devices);

  /// Creates the threads, with the name of their device behind that of `setup`, whose priority is that of services as
  /// they begin and end. Error: what the system refused; call end().
  [[nodiscard]] Result<void> start(const ThreadSetup &setup, const Served &served);
  /// Tells the threads to end, and waits for them. None serves a job. start() can be called again.
  void end();

  /// A job asks the device.
  void join(DeviceId device) { ++states_[device.value].queued; }
  /// The job leaves the queue unserved, because its wait is cancelled.
  void leave(DeviceId device) { --states_[device.value].queued; }
  /// Lets an idle thread of the device serve a job of `task` that has asked it. The scheduler has found a free slot.
  /// With real-time threads, the function runs at the `priority` of the job: it may compute, or wait actively.
  void serve(detail::Wait &wait, TaskId task, int priority, Time now);
  /// The thread has served a job.
  void end_service(DeviceThread &thread, Time now);
  /// Returns true if the calling thread is one of them. After start().
  [[nodiscard]] bool is_this_thread() const;
  /// Makes room for the figures of all devices, and says which devices they are.
  void reserve(std::vector<DeviceFigures> &out) const {
    out.resize(devices_.size());
    for (std::size_t d = 0; d < out.size(); ++d) {
      out[d].device = devices_[d];
      out[d].serves.reserve(devices_[d].slots);
    }
  }
  /// Sets the figures of all devices, by DeviceId, without allocating after reserve().
  void figures(Time now, std::vector<DeviceFigures> &out) const;

 private:
  struct State {
    std::vector<DeviceThread *> idle;
    std::uint32_t queued = 0;
    std::uint64_t served = 0;
    Duration busy = 0;  // of services that have ended
  };

  void main(DeviceThread &self, int priority, const Served &served) noexcept;

  std::vector<Device> devices_;
  std::vector<std::unique_ptr<DeviceThread>> threads_;
  std::vector<State> states_;  // by DeviceId
  Atomic<bool> ending_{false};
};

}  // namespace redag::runtime
