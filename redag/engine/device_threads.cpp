// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/device_threads.hpp"

#include <algorithm>
#include <utility>

#include "redag/base/check.hpp"

namespace redag::runtime {
namespace {

thread_local const DeviceThreads *devices_of_this_thread = nullptr;

}  // namespace

bool DeviceThreads::is_this_thread() const { return devices_of_this_thread == this; }

DeviceThreads::DeviceThreads(std::span<const Device> devices)
    : devices_(devices.begin(), devices.end()), states_(devices.size()) {
  for (std::size_t d = 0; d < devices.size(); ++d) {
    for (std::uint32_t slot = 0; slot < devices[d].slots; ++slot) {
      threads_.push_back(std::make_unique<DeviceThread>());
      threads_.back()->device = DeviceId(d);
    }
    states_[d].idle.reserve(devices[d].slots);
  }
}

Result<void> DeviceThreads::start(const ThreadSetup &setup, const Served &served) {
  for (const auto &thread : threads_) {
    ThreadSetup its_setup = setup;
    its_setup.name += "-" + devices_[thread->device.value].name;
    Result<ThreadHandle> started = start_thread(
        its_setup, [this, served, priority = setup.fifo_priority, &self = *thread] { main(self, priority, served); });
    if (!started) return tl::unexpected(started.error());
    thread->handle = *std::move(started);
    states_[thread->device.value].idle.push_back(thread.get());
  }
  return {};
}

void DeviceThreads::end() {
  ending_.store(true, std::memory_order_release);
  for (const auto &thread : threads_) {
    thread->parker.unpark();
    if (thread->handle.joinable()) thread->handle.join();
  }
  for (State &state : states_) state.idle.clear();
  ending_.store(false, std::memory_order_release);
}

void DeviceThreads::serve(detail::Wait &wait, TaskId task, int priority, Time now) {
  State &state = states_[wait.device.value];
  REDAG_CHECK(!state.idle.empty(), "a device serves more jobs than it has slots");
  DeviceThread &thread = *state.idle.back();
  state.idle.pop_back();
  --state.queued;
  thread.task = task;
  thread.since = now;
  thread.priority = priority;
  thread.wait = &wait;
  thread.parker.unpark();
}

void DeviceThreads::end_service(DeviceThread &thread, Time now) {
  State &state = states_[thread.device.value];
  ++state.served;
  state.busy += std::max<Duration>(0, now - thread.since);
  thread.task = TaskId();
  state.idle.push_back(&thread);
}

void DeviceThreads::figures(Time now, std::vector<DeviceFigures> &out) const {
  out.resize(states_.size());
  for (std::size_t d = 0; d < states_.size(); ++d) {
    out[d].queued = states_[d].queued;
    out[d].served = states_[d].served;
    out[d].busy = states_[d].busy;
    out[d].serves.clear();
  }
  for (const auto &thread : threads_) {
    if (!thread->task.valid()) continue;
    DeviceFigures &device = out[thread->device.value];
    device.busy += std::max<Duration>(0, now - thread->since);
    device.serves.push_back(thread->task);
  }
}

void DeviceThreads::main(DeviceThread &self, int priority, const Served &served) noexcept {
  devices_of_this_thread = this;
  for (;;) {
    self.parker.park();
    detail::Wait *const wait = std::exchange(self.wait, nullptr);
    if (wait == nullptr) {
      if (ending_.load(std::memory_order_acquire)) return;
      continue;
    }
    const bool is_raised = priority > 0;
    if (is_raised) static_cast<void>(set_fifo_priority(self.handle.native_handle(), self.priority));
    try {
      wait->function(wait->argument);
    } catch (...) {
      wait->exception = std::current_exception();
    }
    if (is_raised) static_cast<void>(set_fifo_priority(self.handle.native_handle(), priority));
    served(self, wait->job);
  }
}

}  // namespace redag::runtime
