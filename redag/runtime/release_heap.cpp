// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/release_heap.hpp"

#include <algorithm>

#include "redag/derived/demand.hpp"

namespace redag::runtime {

Duration ReleaseHeap::jitter(const Entry &entry, std::uint32_t number) {
  if (entry.jitter == 0) return 0;
  task_.jitter = entry.jitter;
  return release_jitter(task_, entry.task, number, seed_);
}

void ReleaseHeap::add(const Task &task, TaskId id, Time base) {
  if (task.activation != Activation::Timer) return;
  Entry entry{{0, base + task.offset, id, 0}, task.period, task.jitter};
  entry.seen = entry.nominal + jitter(entry, 0);
  queue_.push(entry);
}

void ReleaseHeap::remove(std::span<const TaskId> tasks) {
  queue_.erase_if([&](const Entry &entry) { return std::find(tasks.begin(), tasks.end(), entry.task) != tasks.end(); });
}

void ReleaseHeap::pop_due(Time now, std::vector<Release> &out) {
  while (out.size() < out.capacity() && next() <= now) {
    Entry entry = queue_.top();
    out.push_back(Release{entry.task, entry.nominal});
    entry.advance(entry.period, jitter(entry, entry.number + 1));
    queue_.replace_top(entry);
  }
}

}  // namespace redag::runtime
