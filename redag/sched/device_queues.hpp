// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Who uses each device, and who waits for it: the jobs that are Queued, and the slots of those that are Away
// (docs/model.md, "Waits"). The job's links hold its place in a queue. Allocates when the devices are set only. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "redag/sched/job_table.hpp"
#include "redag/sched/ready_queue.hpp"

namespace redag::sched {

class DeviceQueues {
 public:
  explicit DeviceQueues(JobTable &table) : table_(table) {}

  /// Takes the devices of the table, and gives the jobs that are Queued their places by their present keys.
  void rebuild();

  /// Lets each device that has a free slot serve the first job of its queue.
  void serve();

  /// The job is Queued from now on.
  void join(std::uint32_t slot);
  /// The job, which is Queued or Away at a device, leaves the queue or its slot.
  void leave(std::uint32_t slot);
  /// The job's key changes between these two calls. It may be in any state.
  void begin_rekey(std::uint32_t slot);
  void end_rekey(std::uint32_t slot);

 private:
  struct State {
    Device device;
    std::uint32_t used = 0;  // slots
    HeapQueue by_priority;
    // Device::Queue::Fifo: a list, linked by Job::next and Job::previous.
    std::uint32_t first = kNil;
    std::uint32_t last = kNil;

    [[nodiscard]] bool is_fifo() const { return device.queue == Device::Queue::Fifo; }
    [[nodiscard]] std::uint32_t top() const { return is_fifo() ? first : by_priority.top(); }
  };

  [[nodiscard]] State &of(std::uint32_t slot) { return devices_[table_.jobs[slot].parked_at]; }
  void add(State &state, std::uint32_t slot);
  void remove(State &state, std::uint32_t slot);

  JobTable &table_;
  std::vector<State> devices_;
};

}  // namespace redag::sched
