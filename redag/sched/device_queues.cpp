// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/sched/device_queues.hpp"

namespace redag::sched {

void DeviceQueues::rebuild() {
  for (std::size_t d = devices_.size(); d < table_.devices.size(); ++d)
    devices_.emplace_back().device = table_.devices[d];
  // A list keeps its order, which does not depend on keys.
  for (State &state : devices_) state.by_priority = HeapQueue();
  for (std::uint32_t slot = 0; slot < table_.jobs.size(); ++slot) {
    if (table_.jobs[slot].state == JobState::Queued && !of(slot).is_fifo()) add(of(slot), slot);
  }
}

void DeviceQueues::serve() {
  for (State &state : devices_) {
    for (std::uint32_t slot = state.top(); slot != kNil && state.used < state.device.slots; slot = state.top()) {
      remove(state, slot);
      ++state.used;
      table_.serve(slot);
    }
  }
}

void DeviceQueues::join(std::uint32_t slot) { add(of(slot), slot); }

void DeviceQueues::leave(std::uint32_t slot) {
  if (table_.jobs[slot].state == JobState::Queued) return remove(of(slot), slot);
  --of(slot).used;
}

void DeviceQueues::begin_rekey(std::uint32_t slot) {
  if (table_.jobs[slot].state == JobState::Queued && !of(slot).is_fifo()) remove(of(slot), slot);
}

void DeviceQueues::end_rekey(std::uint32_t slot) {
  if (table_.jobs[slot].state == JobState::Queued && !of(slot).is_fifo()) add(of(slot), slot);
}

void DeviceQueues::add(State &state, std::uint32_t slot) {
  if (!state.is_fifo()) return state.by_priority.push(table_.jobs, slot);
  Job &job = table_.jobs[slot];
  job.next = kNil;
  job.previous = state.last;
  (state.last == kNil ? state.first : table_.jobs[state.last].next) = slot;
  state.last = slot;
}

void DeviceQueues::remove(State &state, std::uint32_t slot) {
  if (!state.is_fifo()) return state.by_priority.remove(table_.jobs, slot);
  Job &job = table_.jobs[slot];
  (job.previous == kNil ? state.first : table_.jobs[job.previous].next) = job.next;
  (job.next == kNil ? state.last : table_.jobs[job.next].previous) = job.previous;
  job.next = job.previous = kNil;
}

}  // namespace redag::sched
